"""One lamp for a room whose own lamps nobody knows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.interactive_scene import Light
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.geometry.boxes import bottom, top

BELOW_CEILING = 0.15
"""How far the lamp hangs below the ceiling, or the top of the walls [m]; by eye."""
USUAL_HEIGHT = 2.4
"""Of a lamp over the floor where neither is known [m]; by eye."""


def light_of(bodies: Sequence[tuple[str, Box]]) -> Light:
    """Return the lamp of bodies (class, box in the world): over the middle of the floor, below the ceiling."""
    boxes: dict[str, list[Box]] = {}
    for class_name, box in bodies:
        boxes.setdefault(class_name, []).append(box)
    below = boxes.get("floor") or [box for _, box in bodies]
    floor = min((top(box) for box in boxes.get("floor", [])), default=0.0)
    middle = np.mean([box.center[:2] for box in below], axis=0) if below else np.zeros(2)
    above = [bottom(box) for box in boxes.get("ceiling", [])] or [top(box) for box in boxes.get("wall", [])]
    height = min(above) - BELOW_CEILING if above else floor + USUAL_HEIGHT
    return Light(position=as_vector(np.round([*middle, max(height, floor + BELOW_CEILING)], 3)))

"""Furniture in furniture: bodies of a scene that no arm carries, and of which one stands within the box of another."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import permutations

from scenewright.schemas.cad_scene import SURROUNDINGS
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.geometry.boxes import box_volume, boxes_overlap_volume

INSIDE = 0.5
"""Share of a box that lies in another from which on it is in it."""
LEAST = 0.3
"""Furniture is a box of which two edges are as long [m]: what is less, and hangs or stands in the world, is a part."""


def nested(bodies: Iterable[SceneBody]) -> tuple[str, ...]:
    """Return `a in b` for every two pieces of furniture of which more than half the box of one lies in the other's.

    A seat that is pushed under a table counts too: boxes do not know what is hollow.
    """
    layout = {entry.name for entry in load_vocabulary().classes if entry.is_layout}
    furniture = [
        body
        for body in bodies
        if not body.carriable
        and body.class_name not in layout
        and body.name != SURROUNDINGS
        and sorted(body.box.size)[1] >= LEAST
    ]
    return tuple(
        f"{a.name} in {b.name}"
        for a, b in permutations(furniture, 2)
        if boxes_overlap_volume(a.box, b.box) > INSIDE * box_volume(a.box)
    )

"""Who names what a robot's camera sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scenewright.stages.kit.rendering.object_views import Picture


@dataclass(frozen=True)
class Mask:
    """What a segmenter made out: its class, and (H, W) bool."""

    label: str
    mask: np.ndarray


class Segmenter(Protocol):
    """A segmenter."""

    missed: frozenset[str]
    """Things of which a simulated one knows that the last picture showed them, and that are not among its masks."""

    def masks(self, picture: Picture, map_from_camera: np.ndarray, region: object) -> list[Mask]:
        """Return the masks of a picture taken from a pose (4, 4), as it is believed. `region` names the region of views
        within which errors last."""
        ...

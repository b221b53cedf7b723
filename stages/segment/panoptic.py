"""What a panoptic backend says about one frame: masks M_i with class c_i and instance o_i (Han 2024, section 2.3.1)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scenewright.schemas.segments import Witness
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.geometric import GeometricFrame


@dataclass(frozen=True)
class PanopticMask:
    """Class and score of one mask; its number is its value in PanopticFrame.ids."""

    class_id: int
    is_thing: bool
    score: float = 1.0
    witnesses: tuple[Witness, ...] = ()
    """Which networks said what of it, where there are several."""


@dataclass(frozen=True)
class PanopticFrame:
    """Masks that do not overlap. `ids` (H, W) int32, 0 = no mask; `masks` maps every value to what it is."""

    ids: np.ndarray
    masks: dict[int, PanopticMask] = field(default_factory=dict)


class Backend(Protocol):
    """Names panoptic masks in a frame."""

    name: str
    label: str
    """Printed beside every figure that rests on these masks."""
    streams: tuple[str, ...]
    """Streams of the sequence it looks at."""

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of one frame."""
        ...

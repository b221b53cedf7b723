"""Backend `geometric`: class-agnostic. Every geometric segment is one instance of class `object`.

Floors and walls stay objects too: nothing here guesses a class, so that the column it gives in a table is what
geometry alone can do.
"""

from __future__ import annotations

import numpy as np

from schemas.vocabulary import Vocabulary
from stages.kit.formats.frames import Frame
from stages.segment.geometric import GeometricFrame
from stages.segment.panoptic import PanopticFrame, PanopticMask


class GeometricBackend:
    """Masks that are the geometric segments."""

    name = "geometric"
    label = "geometric segments, class-agnostic"
    streams: tuple[str, ...] = ("depth",)

    def __init__(self, vocabulary: Vocabulary) -> None:
        semantic = vocabulary.by_name("object")
        self._mask = PanopticMask(semantic.id, semantic.kind == "thing")

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return a mask per geometric segment."""
        count = int(geometric.labels.max(initial=0))
        return PanopticFrame(ids=geometric.labels, masks=dict.fromkeys(range(1, count + 1), self._mask))

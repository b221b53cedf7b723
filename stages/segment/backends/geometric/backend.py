"""Backend `geometric`: class-agnostic. Every geometric segment is one instance of class `object`.

Floors and walls stay objects too: nothing here guesses a class, so that the column it gives in a table is what
geometry alone can do.
"""

from __future__ import annotations

import numpy as np
from scenewright.schemas.vocabulary import Vocabulary, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame, pixels_at
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask


class GeometricBackend:
    """Masks that are the geometric segments."""

    name = "geometric"
    label = "geometric segments, class-agnostic"
    streams: tuple[str, ...] = ("depth",)

    def __init__(self, vocabulary: Vocabulary, *, minimum_pixels: int) -> None:
        self._minimum_pixels = minimum_pixels
        semantic = vocabulary.by_name("object")
        self._mask = PanopticMask(semantic.id, semantic.kind == "thing")

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return a mask per geometric segment of at least `minimum_pixels` (at 640x480): nobody has recognised
        anything in the smaller ones, and most of them are noise."""
        large = np.bincount(geometric.labels.ravel()) >= pixels_at(self._minimum_pixels, geometric.labels.shape)
        large[0] = False
        ids = np.where(large[geometric.labels], geometric.labels, 0).astype(np.int32)
        return PanopticFrame(ids=ids, masks=dict.fromkeys(np.flatnonzero(large).tolist(), self._mask))


def open_backend(request: BackendRequest) -> GeometricBackend:
    """Return the backend that the request asks for."""
    return GeometricBackend(load_vocabulary(), minimum_pixels=request.parameters.fusion_minimum)

"""Backend `geometric`: no masks. Every segment of the depth is background, and `fuse` finds things by geometry."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.panoptic import PanopticFrame


class GeometricBackend:
    """Nobody names anything."""

    name = "geometric"
    label = "geometry alone, class-agnostic"
    streams: tuple[str, ...] = ("depth",)

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return a frame without masks."""
        return PanopticFrame(np.zeros(geometric.labels.shape, np.int32))


def open_backend(request: BackendRequest) -> GeometricBackend:
    """Return the backend that the request asks for."""
    return GeometricBackend()

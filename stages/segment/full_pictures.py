"""Backends that judge pictures alone are shown the picture at its full size, where the sequence keeps one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.geometry.cameras import seen_by
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.panoptic import Backend, PanopticFrame


class OnFullPictures:
    """A backend whose masks are made on the full picture and brought to the frame's size, the nearest pixel counting.

    A mask of which no pixel is left there is dropped.
    """

    def __init__(self, backend: Backend, reader: FrameReader) -> None:
        self._backend, self._reader = backend, reader
        self.name, self.label = backend.name, f"{backend.label}, on full images"
        self.streams = (*backend.streams, "picture")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._backend, name)

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; one without a picture is judged by its colour. Raises what the backend does."""
        if frame.picture is None:
            return self._backend(frame, geometric, random)
        found = self._backend(replace(frame, color=frame.picture), geometric, random)
        picture, camera = self._reader.picture_cameras[frame.camera_name], self._reader.cameras[frame.camera_name]
        ids = seen_by(found.ids, picture, camera)
        present = set(np.unique(ids).tolist())
        return PanopticFrame(ids, {number: mask for number, mask in found.masks.items() if number in present})

"""Frames of a video file, read in order; going back reopens it, so every frame is the same each time it is read."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE

SUFFIXES = (".mp4", ".avi", ".mkv", ".mov", ".webm")
MOST_FRAMES = 10_000_000
"""Most frames that are counted in a video; a bound against files that never end."""


class VideoFrames:
    """A video file, decoded forward. Raises BadInput when it cannot be opened.

    A file may say that its pictures are to be turned, as phones do; `as_stored` leaves them as the camera took them.
    """

    def __init__(self, path: Path, *, as_stored: bool = False) -> None:
        self.path, self._as_stored = path, as_stored
        self._capture = self._open()
        self._next = 0
        self.rate = float(self._capture.get(cv2.CAP_PROP_FPS))
        """Frames a second as the file states it; 0 when it does not."""
        width, height = (self._capture.get(key) for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        self.size = (round(width), round(height))
        """(width, height) of the frames."""
        if not 0 < width * height <= LARGEST_IMAGE:
            raise BadInput(f"{path}: declares frames of {width:g}x{height:g} pixels")
        self.count = self._count_frames()

    def frame(self, index: int) -> np.ndarray:
        """Return frame `index` as (H, W, 3) uint8 RGB. Raises Unusable when it cannot be decoded."""
        if index < self._next:
            self.close()
            self._capture, self._next = self._open(), 0
        image = None
        while self._next <= index:
            ok = self._capture.grab()
            self._next += 1
            if not ok:
                break
            if self._next > index:
                ok, image = self._capture.retrieve()
        if image is None:
            raise Unusable("undecodable_color", f"frame {index} of {self.path.name}")
        return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)

    def close(self) -> None:
        """Close the file."""
        self._capture.release()

    def _open(self) -> cv2.VideoCapture:
        capture = cv2.VideoCapture(str(self.path))
        if not capture.isOpened():
            raise BadInput(f"{self.path}: is no video that can be read", hint="export its frames as images")
        if self._as_stored:
            capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        return capture

    def _count_frames(self) -> int:
        """Return the number of frames that can be decoded: what the file declares is often wrong."""
        count = 0
        while count < MOST_FRAMES and self._capture.grab():
            count += 1
        self._next = count
        return count

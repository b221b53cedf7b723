"""Frames of a video file, read in order; going back reopens it, so every frame is the same each time it is read."""

from __future__ import annotations

import os
import re
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE

SUFFIXES = (".mp4", ".avi", ".mkv", ".mov", ".webm")
HDR_TRANSFERS = (16, 18)
"""Transfer characteristics of PQ and HLG (ITU-T H.273)."""
COLOR_BOX = re.compile(rb"colrncl[xc]..(..)", re.DOTALL)
"""Colour information of a track of MP4 or QuickTime (ISO/IEC 14496-12, 12.1.5): primaries, transfer, matrix."""
SEARCHED = 4 * 2**20
"""Bytes at the beginning and the end of a file in which the tracks are described."""
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

    @property
    def notes(self) -> tuple[str, ...]:
        """What there is to say of its pictures."""
        if not is_hdr(self.path):
            return ()
        return (f"WARNING: {self.path.name} is HDR, of which no tones are mapped: colours are off, shapes are not",)

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
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what is wrong is said once, in our words
        capture = cv2.VideoCapture(str(self.path))
        if not capture.isOpened():
            raise BadInput(f"{self.path}: is not a video that can be read", hint="export its frames as images")
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


def is_hdr(path: Path) -> bool:
    """Whether a video says that its values are those of PQ or HLG, which OpenCV reads as if they were usual ones."""
    with opened(path) as file:
        data = file.read(SEARCHED)
        file.seek(max(0, os.fstat(file.fileno()).st_size - SEARCHED))
        data += file.read(SEARCHED)
    return any(int.from_bytes(found, "big") in HDR_TRANSFERS for found in COLOR_BOX.findall(data))

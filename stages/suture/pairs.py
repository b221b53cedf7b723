"""The stereo pairs of a sequence, with the rig that its calibration says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.suture_scene import StereoRigRecord
from scenewright.stages.kit.formats.foxglove import nanoseconds
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.suture.rig import StereoRig

SMALLEST_BASELINE = 1e-4
"""Eyes nearer than this [m] are one."""
SQUARE = 1e-3
"""Relative difference of the focal lengths up to which pixels count as square."""


@dataclass(frozen=True)
class Pair:
    """One frame: pictures (H, W, 3) uint8 RGB of both eyes; `stamp` [ns] is that of its disparity."""

    index: int
    time: float
    stamp: int
    left: np.ndarray
    right: np.ndarray

    @property
    def pictures(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Both pictures; None where their sizes alone were looked at."""
        return (self.left, self.right) if self.left.shape[2] and self.right.shape[2] else None


class StereoPairs:
    """Reads the pairs of the first camera of a sequence that has two eyes. Used as a context manager.

    Raises BadInput for a sequence without frames, with one eye, without or with a negative baseline, or whose pixels
    are not square.
    """

    def __init__(self, sequence: Sequence) -> None:
        self._where = sequence.root
        self._reader = FrameReader(sequence.path("frames.mcap"))
        try:
            self.camera_name, self.camera, self.baseline = self._open()
        except BaseException:
            self._reader.close()
            raise

    def __enter__(self) -> StereoPairs:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()

    def _open(self) -> tuple[str, Camera, float]:
        reader, where = self._reader, self._where
        if len(reader) == 0:
            raise BadInput(f"{where}: it has no frames", hint="look at the drops in its sequence.json")
        if "right" not in reader.streams or "color" not in reader.streams:
            raise BadInput(
                f"{where}: its frames have one eye ({', '.join(reader.streams)})",
                hint="give the sequence with both eyes: `disparity` keeps the left one only",
            )
        name, baseline = next(iter(reader.baselines.items()))
        if not math.isfinite(baseline) or abs(baseline) < SMALLEST_BASELINE:
            raise BadInput(
                f"{where}: the eyes of {name!r} have no baseline ({baseline:g} m): two eyes at one place see no depth",
                hint="correct P[3] of the right calibration (minus fx times the baseline)",
            )
        if baseline < 0:
            raise BadInput(
                f"{where}: left and right of {name!r} are exchanged: the baseline is {baseline:g} m",
                hint="ingest with the two eyes exchanged",
            )
        camera = reader.cameras[name]
        if abs(camera.fx / camera.fy - 1.0) > SQUARE:
            raise BadInput(
                f"{where}: the pixels of {name!r} are not square (fx {camera.fx:g}, fy {camera.fy:g})",
                hint="rectify to square pixels",
            )
        return name, camera, baseline

    @property
    def rig(self) -> StereoRig:
        """The rig by the calibration."""
        camera = self.camera
        return StereoRig(camera.width, camera.height, camera.fx, (camera.cx, camera.cy), self.baseline)

    @property
    def record(self) -> StereoRigRecord:
        """The rig as artifacts keep it."""
        return StereoRigRecord(camera=self.camera, baseline=self.baseline)

    def __len__(self) -> int:
        return len(self._reader)

    def __iter__(self) -> Iterator[Pair]:
        """Yield the frames that have both eyes. Raises BadInput where the eyes' sizes differ from the calibration's."""
        size = (self.camera.height, self.camera.width)
        for index in range(len(self._reader)):
            frame = self._reader.read(index, ("color", "right"))
            if frame.camera_name != self.camera_name or frame.color is None or frame.right is None:
                continue
            for side, picture in (("left", frame.color), ("right", frame.right)):
                if picture.shape[:2] != size:
                    raise BadInput(
                        f"{self._where}: frame {index}: the {side} image is {picture.shape[1]} x {picture.shape[0]}, "
                        f"the calibration says {size[1]} x {size[0]}",
                        hint="rectify both eyes to one size",
                    )
            yield Pair(index, frame.time, nanoseconds(frame.time), frame.color, frame.right)

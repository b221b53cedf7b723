"""What decoded messages are to the rest of ingest, whatever dialect they were written in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


class Undecodable(Exception):
    """A message that does not hold what its type promises. The text is the reason, for people, without the values
    that were found, so that messages can be counted by it.

    Of a list of transforms some may hold all the same: `records` has these.
    """

    def __init__(self, reason: str, records: tuple[Record, ...] = ()) -> None:
        super().__init__(reason)
        self.records = records


@dataclass(frozen=True)
class ImageRecord:
    """An image, raw or compressed, not decoded to pixels yet."""

    stamp: int
    """Header stamp [ns]; 0 = the message has none."""
    frame_id: str
    encoding: str
    """Of raw images the ROS encoding (`rgb8`, `16UC1`, `32FC1`, `bayer_rggb8`, `yuv422`, ...); of compressed ones their
    `format` field as it stands (`jpeg`, `png`, `rgb8; jpeg compressed bgr8`, `16UC1; compressedDepth png`,
    `32FC1; compressedDepth rvl`, ...)."""
    compressed: bool
    width: int
    """0 for compressed images."""
    height: int
    step: int
    """Bytes of a row, raw images only."""
    big_endian: bool
    data: bytes
    units_per_metre: float | None = None
    """Of depth, where the message itself states it."""


@dataclass(frozen=True)
class CalibrationRecord:
    """CameraInfo or CameraCalibration."""

    stamp: int
    frame_id: str
    width: int
    height: int
    distortion_model: str
    D: tuple[float, ...]
    K: tuple[float, ...]
    """9 numbers, row major."""
    R: tuple[float, ...]
    """9 numbers, row major, or empty."""
    P: tuple[float, ...]
    """12 numbers, row major, or empty."""


@dataclass(frozen=True)
class TransformRecord:
    """One edge of the tree of frames."""

    stamp: int
    parent: str
    child: str
    parent_from_child: np.ndarray
    """(4, 4), rigid."""


@dataclass(frozen=True)
class PoseRecord:
    """Odometry, PoseStamped, PoseWithCovarianceStamped, PoseInFrame."""

    stamp: int
    frame_id: str
    child_frame_id: str
    """Empty where the type has none (PoseStamped)."""
    parent_from_child: np.ndarray
    """(4, 4), rigid."""


@dataclass(frozen=True)
class ImuRecord:
    """An inertial measurement."""

    stamp: int
    frame_id: str
    acceleration: np.ndarray
    """(3,) proper acceleration [m/s^2]: +9.81 along up at rest (REP-145)."""


@dataclass(frozen=True)
class PointsRecord:
    """That there was a point cloud; its points are not used."""

    stamp: int
    frame_id: str


Record = ImageRecord | CalibrationRecord | TransformRecord | PoseRecord | ImuRecord | PointsRecord

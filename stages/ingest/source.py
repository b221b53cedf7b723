"""What every log format is turned into: a list of frames that are loaded one at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import LabelEntry

Role = Literal[
    "color", "depth", "right", "labels", "calibration", "transforms", "pose", "imu", "points", "other", "unreadable"
]


class Unusable(Exception):
    """One frame that cannot be used. `reason` is counted in the sequence's drops, `detail` is logged."""

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail


@dataclass(frozen=True)
class FrameFiles:
    """The files of one frame. None is a file that is missing, or a log that has none."""

    color: Path | None = None
    depth: Path | None = None


@dataclass(frozen=True)
class LoadedFrame:
    """The images of one frame, at the size of its camera. At least one of colour and depth is there."""

    color: np.ndarray | bytes | None
    """(H, W, 3) uint8 RGB, or the log's own JPEG or PNG bytes where these can be kept as they are. Left eye of a
    stereo pair."""
    depth: np.ndarray | None
    """(H, W) uint16 [mm], 0 = invalid."""
    labels: np.ndarray | None = None
    """(H, W) uint16 instance ids."""
    right: np.ndarray | bytes | None = None
    """Right eye of a rectified stereo pair, like `color`."""
    deviation: np.ndarray | None = None
    """(H, W) float32 standard deviation of depth [m], 0 = unknown."""
    picture: np.ndarray | bytes | None = None
    """Colour at its full size, like `color`, where that is larger than the frame."""


@dataclass(frozen=True)
class SourceCamera:
    """One camera of the log, as its frames come out of `load`: without distortion, rectified."""

    name: str
    """`camera` where a log has one; else unique in the log, of letters, digits and underscores."""
    camera: Camera
    baseline: float | None = None
    """Distance of the right eye along +x [m], when frames have a right image; negative where a calibration says that
    it is the left one, until `settled_eyes` has looked at the pictures."""
    registered: bool = True
    """Whether depth pixels and colour pixels see the same ray, as far as the log says."""
    picture: Camera | None = None
    """The same camera at the size of the frames' pictures, where these are larger than the frames."""
    eyes: tuple[str, str] = ("left", "right")
    """What the two eyes are called in the log: topics, or folders."""


@dataclass(frozen=True)
class Entry:
    """One frame of the log, not loaded yet."""

    name: str
    """For messages: a file name, or a stamp."""
    time: float
    world_from_camera: np.ndarray | None
    """(4, 4) as the log has it, not checked yet; None when the log has none for this frame."""
    load: Callable[[], LoadedFrame]
    """Raises Unusable."""
    problem: str | None = None
    """Reason for which the frame is known to be unusable without loading it."""
    camera_name: str = "camera"
    files: FrameFiles = FrameFiles()
    stamp: int | None = None
    """Time of its picture as the log states it, of its depth where there is none [ns]."""


@dataclass(frozen=True)
class StreamInfo:
    """One stream of the log as it was recorded, for `inspect` and for people."""

    name: str
    """Topic, folder or file."""
    role: Role
    detail: str = ""
    """Type and encoding, for people."""
    stamps: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """(N,) int64 header stamps [ns] in file order; empty when the stream carries none."""
    count: int = 0
    log_delay: float | None = None
    """Median of log time minus header stamp [s]."""


@dataclass(frozen=True)
class LogSource:
    """A log that was recognised. Entries and cameras are those that the options chose."""

    format: str
    rule: str
    cameras: tuple[SourceCamera, ...]
    """The first is the main one."""
    entries: tuple[Entry, ...]
    """Every frame of the log in time order, usable or not."""
    notes: tuple[str, ...] = ()
    """What was assumed, for people."""
    world_up: Literal["z", "unknown"] = "unknown"
    """`z` when the log itself says that z of its world is up."""
    world_up_detail: str = ""
    up_in_log: np.ndarray | None = None
    """(3,) up in the log's world as measured by an IMU, where the log has one."""
    label_table: tuple[LabelEntry, ...] = ()
    has_labels: bool = False
    has_deviation: bool = False
    damage: tuple[str, ...] = ()
    """What of the log could not be read at all (torn end, damaged chunks, messages that do not decode): one line each,
    with counts and places."""
    streams: tuple[StreamInfo, ...] = ()
    other_cameras: tuple[str, ...] = ()
    """Cameras of the log that were not asked for."""
    missing: Mapping[str, str] = field(default_factory=dict)
    """Stream (`depth`, `pose`) that the log lacks -> why, where it holds something of the kind."""
    close: Callable[[], None] = field(default=lambda: None)

    @property
    def camera(self) -> Camera:
        """The main camera."""
        return self.cameras[0].camera

    @property
    def has_poses(self) -> bool:
        """Whether any frame has a pose."""
        return any(entry.world_from_camera is not None for entry in self.entries)

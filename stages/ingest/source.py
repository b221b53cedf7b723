"""What every log format is turned into: a list of frames that are loaded one at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from schemas.scene_parts import Camera
from schemas.sequence import LabelEntry


class Unusable(Exception):
    """One frame that cannot be used. `reason` is counted in the sequence's drops, `detail` is logged."""

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail


@dataclass(frozen=True)
class LoadedFrame:
    """The images of one frame, at the size of the source's camera."""

    color: np.ndarray | bytes
    """(H, W, 3) uint8 RGB, or the log's own JPEG bytes where these can be kept as they are."""
    depth: np.ndarray
    """(H, W) uint16 [mm], 0 = invalid."""
    labels: np.ndarray | None = None


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


@dataclass(frozen=True)
class LogSource:
    """A log that was recognised."""

    format: str
    rule: str
    camera: Camera
    entries: tuple[Entry, ...]
    """Every frame of the log in time order, usable or not."""
    notes: tuple[str, ...] = ()
    """What was assumed, for people."""
    world_up: Literal["z", "unknown"] = "unknown"
    """`z` when the log itself says that z of its world is up."""
    world_up_detail: str = ""
    label_table: tuple[LabelEntry, ...] = ()
    has_labels: bool = False
    registered: bool = True
    """Whether depth pixels and colour pixels see the same ray, as far as the log says."""
    close: Callable[[], None] = field(default=lambda: None)

    @property
    def has_poses(self) -> bool:
        """Whether any frame has a pose."""
        return any(entry.world_from_camera is not None for entry in self.entries)

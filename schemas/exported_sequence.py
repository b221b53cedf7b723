"""Kind `exported_sequence`: a sequence written back as a log that other tools read."""

from __future__ import annotations

from typing import ClassVar

from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Count, Model


class ExportFile(Model):
    """export.json: what was written, and what the layout could not hold."""

    layout: str
    """A layout of `export` (docs/FORMATS.md)."""
    dialect: str | None = None
    """Which of several formats of that layout: of `mcap`, the message types."""
    log: str
    """What to open, relative to this folder: `.` or a file."""
    cameras: tuple[str, ...]
    streams: tuple[str, ...]
    """Streams that some frame has in the export."""
    frame_count: int
    frames_in_sequence: int
    left_out: dict[str, int] = {}
    """Reason -> frames of the sequence that are not in the export."""
    depth_pixels_zeroed: Count = 0
    """Pixels whose depth is too large for the layout's unit; they are 0 = invalid."""
    depth_limit: float | None = None
    """Largest depth that the layout holds [m]."""
    notes: tuple[str, ...] = ()
    """What a reader has to know (conventions, units, streams that the layout has no place for)."""


class ExportedSequence(Artifact):
    """`export.json` and the layout's own files: TUM `rgb/ depth/ rgb.txt depth.txt groundtruth.txt calibration.txt`,
    nerfstudio `images/ depth/ transforms.json`, `log.mcap`, or COCO `images/ panoptic/ panoptic.json
    instances.json`."""

    kind: ClassVar[str] = "exported_sequence"
    description: ClassVar[str] = "a sequence written back as TUM, nerfstudio, MCAP or COCO"
    info = Document(ExportFile, "export.json")

"""Kind `disparity`: a sequence whose depth was computed from its stereo pairs, with disparity and confidence."""

from __future__ import annotations

from typing import ClassVar, Literal

from scenewright.schemas.artifact import Document
from scenewright.schemas.base import Model
from scenewright.schemas.sequence import Sequence


class RowReport(Model):
    """Whether both eyes of a camera see a point in the same row, by features that match."""

    camera: str
    verdict: Literal["rectified", "corrected", "not_rectified", "not_checked"]
    """`corrected`: it was not, a small turn of the right eye explained it, and the pictures were turned back."""
    frames: int
    """Frames that were looked at."""
    matches: int
    row_error: float | None = None
    """Median distance of the rows of matched features [px]; None with fewer than 40 matches."""
    row_error_90: float | None = None
    """90th percentile of it [px]."""
    row_offset: float | None = None
    """Median of right row minus left row [px]."""
    pitch: float | None = None
    roll: float | None = None
    """Turn of the right eye about its x and z axes that explains the rows best [rad]."""
    corrected_row_error: float | None = None
    """Median distance of the rows when that turn is undone [px]."""
    negative_share: float | None = None
    """Share of the matches with a negative disparity: near 1 when left and right are swapped."""


class FrameDisparity(Model):
    """One frame of the artifact."""

    frame: int
    """Index in `frames.mcap`."""
    input_frame: int
    """Index in the sequence that was read."""
    lowest: int
    levels: int
    """What was searched: disparities from `lowest`, `levels` of them [px]."""
    known: float
    """Share of the pixels with a disparity."""
    trusted: float
    """Share of the pixels with depth: known, and of at least the least confidence."""
    median_disparity: float | None
    """[px]"""
    median_depth: float | None
    """[m]"""


class DisparityFile(Model):
    """disparity.json."""

    method: Literal["semi-global", "raft-stereo"]
    detail: str
    """The matcher and its settings, for people."""
    minimum_confidence: float
    """Less confident disparities are kept, but give no depth."""
    rows: tuple[RowReport, ...]
    """One a camera."""
    frames: tuple[FrameDisparity, ...]
    left_out: dict[str, int] = {}
    """Reason -> frames of the sequence that have no disparity (`no_right_eye`, `nothing_matches`)."""


class Disparity(Sequence):
    """A sequence in all that a step reads (`frames.mcap`, `sequence.json`, `trajectory.tum`), with depth from stereo;
    beside it `disparity.mcap` (stages/kit/formats/disparity_file.py) and `disparity.json`."""

    kind: ClassVar[str] = "disparity"
    schema_version: ClassVar[int] = 1
    description: ClassVar[str] = "sequence with disparity, confidence and depth from stereo pairs"
    matching = Document(DisparityFile, "disparity.json")

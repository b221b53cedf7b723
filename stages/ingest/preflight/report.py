"""What the pre-flight says: one document with stable keys (docs/LOGS.md), the same for people, JSON and HTML."""

from __future__ import annotations

import math
from typing import Literal

from scenewright.schemas.base import Model
from scenewright.schemas.scene_parts import Camera

SCHEMA_VERSION = 1
"""Version of the inspection's JSON."""
Severity = Literal["wasted", "doubtful", "note"]
Verdict = Literal["ready", "doubtful", "wasted"]
PoseVerdict = Literal["agree", "contradict", "doubtful", "not checked", "none"]


def significant(value: float | None, digits: int = 4) -> float | None:
    """Return a number rounded to significant digits, None for None and for what is not finite."""
    if value is None or not math.isfinite(value):
        return None
    return float(f"{float(value):.{digits}g}")


def exact(value: float, digits: int = 4) -> float:
    """Return a number rounded to significant digits; 0 for what is not finite."""
    return significant(value, digits) or 0.0


class Finding(Model):
    """One thing that is wrong, or worth knowing."""

    severity: Severity
    check: str
    """Which part of the pre-flight says so: streams, frames, depth, poses, calibration, registration, ..."""
    message: str
    fix: str = ""
    camera: str = ""
    """Camera it concerns; empty for the whole log."""


class Gaps(Model):
    """Intervals of a stream over three times its median."""

    count: int = 0
    longest: float = 0.0
    """Seconds."""
    longest_at: float | None = None
    """Stamp at which the longest begins [s]."""


class StreamReport(Model):
    """One stream of the log."""

    name: str
    role: str
    detail: str = ""
    count: int
    rate: float | None = None
    """1 / median interval [1/s]."""
    first: float | None = None
    last: float | None = None
    """Stamps [s]."""
    gaps: Gaps = Gaps()
    duplicates: int = 0
    """Stamps that occurred before."""
    reversals: int = 0
    """Stamps before the one that precedes them in the file."""
    log_delay: float | None = None
    """Median of log time minus header stamp [s]."""


class FramesReport(Model):
    """What becomes of the frames of the log."""

    in_log: int
    selected: int
    """Frames that ingest would load."""
    looked_at: int
    """Frames whose pixels were looked at here."""
    drops: dict[str, int] = {}
    """Reason -> frames left out without loading them."""
    unusable: dict[str, int] = {}
    """Reason -> frames among those looked at that cannot be used."""
    start: float | None = None
    end: float | None = None
    """Times of the first and last selected frame [s]."""


class CalibrationReport(Model):
    """Intrinsics against the image size."""

    plausible: bool
    field_of_view: tuple[float, float]
    """Horizontal and vertical [deg]."""
    focal_aspect: float
    """fx / fy."""
    center_offset: tuple[float, float]
    """Principal point minus image centre, as share of width and height."""
    focal_fit: float | None = None
    """Factor on the focal lengths with which frames agree best, where depth and poses tell."""


class DepthReport(Model):
    """Depth of the frames that were looked at."""

    frames: int
    valid_share: float
    median: float
    """Median of the frames' medians [m]."""
    low: float
    high: float
    """5th and 95th percentile of all valid depth [m]."""
    plausible: bool
    factor: float | None = None
    """What depth should be multiplied by, where something tells."""
    factor_by: Literal["poses", "plausibility"] | None = None
    step: float
    """Smallest difference of depth values that occurs [m]."""
    distinct_values: int
    """Median number of different values in a frame."""
    saturated_share: float
    """Share of the valid pixels at the largest value of all frames."""
    saturated_value: float
    histogram: tuple[float, ...]
    """Shares of valid pixels in equal bins from 0 to `histogram_end`."""
    histogram_end: float
    """[m]."""


class Hypothesis(Model):
    """How well frames agree when the poses are taken in one way."""

    convention: str
    """A name of POSE_CONVENTIONS, or `motionless`."""
    translation_scale: float = 1.0
    """What translations are multiplied by."""
    focal_factor: float = 1.0
    """What focal lengths are multiplied by."""
    lag: int = 0
    """Picture i gets pose i + lag."""
    residual: float
    """Median over pairs of the median |predicted - measured| / measured depth; epipolar: pixels."""
    cost: float
    """Mean over pairs of that, truncated at 5 % (epipolar: 4 pixels), as share of the truncation; ranks hypotheses."""
    overlap: float
    """Median share of pixels that fall into the other picture."""


class PoseReport(Model):
    """Whether the poses agree with the pictures."""

    verdict: PoseVerdict
    method: Literal["depth", "epipolar", "none"]
    detail: str
    pairs: int = 0
    hypotheses: tuple[Hypothesis, ...] = ()
    """Poses as they are first, then by cost."""
    motionless: Hypothesis | None = None
    """The same with no motion at all: what any poses must beat."""
    best: Hypothesis | None = None
    """What fits, when the poses as they are do not."""
    runner_up: Hypothesis | None = None
    decisive: bool = False
    """Whether the best beats every other by a clear ratio, pair by pair."""
    turns_only: bool = False
    """Whether the frames agree best when the translations are left out: turns right, translations noise."""
    scale_fit: float | None = None
    """Factor on the translations (as they are, or in the best convention) with which frames agree best."""
    lag_frames: int | None = None
    """Frames by which the poses are late (positive: pose i + lag fits picture i best), when decisive."""
    colour_verdict: PoseVerdict | None = None
    """What matched features say of the poses as they are, where depth and poses disagree."""
    colour_residual: float | None = None
    """[pixels]"""
    bad_pairs: int = 0
    """Pairs that disagree although the poses as a whole agree."""
    bad_times: tuple[float, ...] = ()
    """Times [s] of the first of those."""


class DriftReport(Model):
    """By how much poses miss places that the camera comes back to: medians over pairs of frames that were aligned."""

    places: int
    missed: float
    """[m]"""
    way: float
    """Between the two frames, a radian of turning counted as a metre [m]."""
    neighbours_missed: float
    """The same of frames that follow each other closely: what alignment itself is off [m]."""


class RegistrationReport(Model):
    """Whether colour and depth show the same thing at the same place and time."""

    checked: bool
    detail: str
    score: float | None = None
    """Colour gradient under depth jumps over the mean gradient: 1 is chance."""
    offset: tuple[int, int] | None = None
    """Shift of colour against depth at which edges coincide best [pixels of the full image]."""
    offset_score: float | None = None
    lag_frames: float | None = None
    """Frames by which colour is late against depth (positive: colour of frame i shows what depth i - lag shows)."""
    lag_decisive: bool = False
    lag_scores: tuple[tuple[int, float], ...] = ()
    """(lag, score) for every lag that was tried."""


class PictureReport(Model):
    """Blur and exposure of the colour images that were looked at."""

    frames: int
    sharpness_median: float
    """Variance of the Laplacian at 320 pixels width."""
    blurred_share: float
    dark_share: float
    """Mean share of pixels under 8."""
    bright_share: float
    """Mean share of pixels over 247."""
    brightness: float
    """Mean, 0 to 255."""
    flicker: float
    """Median relative change of brightness between neighbours."""
    repeated_share: float
    """Share of neighbours that are the same picture."""


class MotionReport(Model):
    """How the poses move."""

    length: float
    """Of the path [m]."""
    extent: tuple[float, float, float]
    """Of the box around the path [m]."""
    step_median: float
    step_largest: float
    """Between neighbours [m]."""
    turn_median: float
    turn_largest: float
    """Between neighbours [deg]."""
    speed_median: float
    """[m/s]."""
    jumps: int
    jump_times: tuple[float, ...] = ()
    """Stamps [s] after which the first jumps come."""
    repeated_share: float
    """Share of poses equal to the one before."""
    overlap: float | None = None
    """Median share of a frame that the next one sees too, by poses and depth."""


class StereoReport(Model):
    """Rectified or not, which eye is which."""

    checked: bool
    detail: str
    baseline: float | None = None
    matches: int = 0
    row_error: float | None = None
    """Median vertical distance of matches [pixels]."""
    positive_share: float | None = None
    """Share of matches whose disparity is positive; near 0 the eyes are swapped."""
    median_disparity: float | None = None


class CameraReport(Model):
    """Everything about one camera."""

    name: str
    camera: Camera
    registered: bool
    frames: int
    streams: tuple[str, ...]
    calibration: CalibrationReport
    depth: DepthReport | None = None
    poses: PoseReport
    registration: RegistrationReport
    pictures: PictureReport | None = None
    motion: MotionReport | None = None
    drift: DriftReport | None = None
    """None where the poses do not agree with the depth, or the camera does not come back."""
    stereo: StereoReport | None = None


class GravityReport(Model):
    """What ingest would do to make the world upright."""

    method: str
    detail: str
    tilt: float | None = None
    """Angle between the log's z axis and up [deg]."""


class StepReport(Model):
    """Whether a step can run on this log."""

    step: str
    ready: bool
    missing: tuple[str, ...] = ()


class InspectionReport(Model):
    """The whole pre-flight."""

    schema_version: int = SCHEMA_VERSION
    path: str
    format: str
    rule: str
    verdict: Verdict
    reason: str
    """The gravest finding, empty when ready."""
    fix: str
    findings: tuple[Finding, ...]
    frames: FramesReport
    damage: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    streams: tuple[StreamReport, ...]
    clocks: tuple[str, ...] = ()
    """What was found when stamps of streams were compared."""
    cameras: tuple[CameraReport, ...]
    other_cameras: tuple[str, ...] = ()
    gravity: GravityReport
    steps: tuple[StepReport, ...]
    command: str = ""
    """The command line that reconstructs this log as it was looked at, empty where a chain on it would be wasted."""

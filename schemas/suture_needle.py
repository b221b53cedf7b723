"""Kinds `suture_needle`, the pose of a needle with its covariance or an abstention, and `suture_thread`, a curve.

Everything is in the left camera's frame (schemas/suture_scene.py) [m, rad].
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Transform
from scenewright.schemas.suture_scene import MOST_VIEWS, Share, StereoRigRecord


def _check_square(value: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len(value) != 6 or any(len(row) != 6 for row in value):
        raise ValueError("expected 6x6 numbers")
    return value


Covariance = Annotated[tuple[tuple[float, ...], ...], AfterValidator(_check_square)]
"""Of the centre's error [m] and of the rotation vector [rad] that turns the estimate into the truth."""
MaskSource = Literal["network", "files", "truth", "spoiled"]
"""`network`: a learned segmenter; `files`: the user's masks; `truth`: the rendered truth; `spoiled`: the truth with the
structured errors of a learned mask."""


class NeedleEstimateRecord(Model):
    """An estimate, or why there is none: `abstained` is empty, or one sentence; a pose is then a guess at best."""

    camera_from_needle: Transform | None
    covariance: Covariance | None
    """None where the estimator states none."""
    tip_probability: Share
    """That tip and swage are not exchanged."""
    abstained: str

    @model_validator(mode="after")
    def _an_answer_has_a_pose(self) -> NeedleEstimateRecord:
        if not self.abstained and self.camera_from_needle is None:
            raise ValueError("an estimate without a pose must say why it abstains")
        return self


class NeedleFrame(Model):
    """What was made of one frame."""

    frame: int = Field(ge=0)
    time: float
    estimate: NeedleEstimateRecord
    mask_pixels: tuple[int, int]
    """Of the needle in the left and in the right eye."""


class SutureNeedleFile(Model):
    """needle.json."""

    statement: str
    """One line: where the needle is and how sure that is, or why it is not known."""
    estimator: Literal["ours", "thesis"]
    masks: MaskSource
    masks_from: str
    """The masks' origin in words."""
    disparity: str
    """The matcher whose disparity was used; empty without."""
    rig: StereoRigRecord
    needle_radius: float = Field(gt=0.0)
    """Of the half circle [m]: as it was told, or fitted."""
    needle_radius_deviation: float | None = Field(None, gt=0.0)
    """Standard deviation [m] of a fitted radius; None where it was told."""
    frames: tuple[NeedleFrame, ...] = Field(max_length=MOST_VIEWS)
    filtered: NeedleEstimateRecord | None
    """The filter's estimate in the last frame, from all of them; None where frames were not filtered."""
    filter: Literal["none", "kinematics", "still"]
    """Which motion carried the needle from frame to frame."""


class SutureNeedle(Artifact):
    """`needle.json`, and `pictures/<frame:06d>.png`: both eyes with mask, circle, ends and 95 % ellipses."""

    kind: ClassVar[str] = "suture_needle"
    description: ClassVar[str] = "pose of a suture needle with its covariance, or an abstention"
    info = Document(SutureNeedleFile, "needle.json")


class ThreadFrame(Model):
    """The thread of one frame; the curve itself is in threads.npz."""

    frame: int = Field(ge=0)
    time: float
    points: int = Field(ge=0)
    """0: there is no curve, and `status` says why."""
    length: float = Field(ge=0.0)
    """[m]"""
    status: str
    remarks: tuple[str, ...] = ()
    mask_pixels: tuple[int, int]


class SutureThreadFile(Model):
    """thread.json."""

    statement: str
    masks: MaskSource
    masks_from: str
    rig: StereoRigRecord
    started_at_needle: bool
    """Whether the needle's swage said where the thread begins."""
    frames: tuple[ThreadFrame, ...] = Field(max_length=MOST_VIEWS)


class SutureThread(Artifact):
    """`thread.json`, `threads.npz` (`points_<frame:06d>` (N, 3) [m] and `deviation_<frame:06d>` (N,) [m], of the frames
    with a curve), `pictures/<frame:06d>.png`."""

    kind: ClassVar[str] = "suture_thread"
    description: ClassVar[str] = "the thread's curve in space"
    info = Document(SutureThreadFile, "thread.json")

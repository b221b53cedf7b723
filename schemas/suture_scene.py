"""Kind `suture_scene`: rendered stereo pairs of a needle and its thread over a wound pad, with the truth about them.

Frames are OpenCV's (x right, y down, z forward) of the left camera; lengths in metres. The needle's frame: origin at
the circle's centre, z along its normal; the arc runs from the tip (angle 0, on +x) to the swage (angle pi)
right-handed about z.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Document
from scenewright.schemas.base import Model, Seed, Transform, Vector3
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence

MOST_VIEWS = 2000
"""Most views of a scene; a bound, by eye."""
Holder = Literal["air", "left", "right", "both", "tissue"]
Place = Literal["wound", "left", "right", "high", "corner"]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class StereoRigRecord(Model):
    """A rectified stereo pair: the left camera, and how far along +x the right one stands [m]."""

    camera: Camera
    baseline: float = Field(gt=0.0)


class RigFile(StereoRigRecord):
    """A user's rig.json: the pair, and the needle that is used with it, where it is known."""

    needle_radius: float | None = Field(None, ge=0.002, le=0.05)
    """Of the half circle [m]."""


class SutureView(Model):
    """The truth of one frame."""

    frame: int = Field(ge=0)
    seed: Seed
    holder: Holder
    """Who holds the needle."""
    place: Place
    """Where in the workspace it is."""
    camera_from_needle: Transform
    camera_from_world: Transform
    right_eye_turn: Vector3
    """Rotation vector by which the right camera differs from its calibration [rad]."""
    seen: Share
    """The smaller of the two eyes' shares of the arc that is seen."""
    degrees_from_edge_on: float
    """Angle between the needle's plane and the left eye's line of sight [deg]."""
    reported_motion: Transform | None = None
    """Of a sequence: how the needle moved since the frame before (left camera's frame), as kinematics report it, with
    their error; None in the first frame."""


class SutureSceneFile(Model):
    """scene.json."""

    seed: Seed
    arrangement: Literal["motion", "views"]
    """`motion`: one needle that moves; `views`: every frame another scene."""
    rig: StereoRigRecord
    rig_name: Literal["two_cameras", "endoscope"]
    needle_radius: float = Field(gt=0.0)
    calibration_error: float = Field(ge=0.0)
    """Standard deviation of the right image's shift [px] that the calibration does not know of."""
    bodies: dict[str, int]
    """Values of the truth images."""
    views: tuple[SutureView, ...] = Field(max_length=MOST_VIEWS)

    @model_validator(mode="after")
    def _frames_are_numbered(self) -> SutureSceneFile:
        if [view.frame for view in self.views] != list(range(len(self.views))):
            raise ValueError("views must be numbered 0, 1, 2, ... in their order")
        return self


class SutureScene(Sequence):
    """A sequence in all that a step reads (`frames.mcap` with both eyes, `sequence.json`, `trajectory.tum`); beside it
    the truth: `scene.json`, `truth/<frame:06d>_left.png` and `_right.png` (8 bit, `bodies`), `_disparity.png` (16 bit,
    1/128 px, left eye, 0 unknown), and `threads.npz` (`thread_<frame:06d>` (N, 3) [m], left camera's frame, from the
    swage on)."""

    kind: ClassVar[str] = "suture_scene"
    schema_version: ClassVar[int] = 1
    description: ClassVar[str] = "rendered stereo pairs of a suture needle, with the truth"
    truth = Document(SutureSceneFile, "scene.json")

"""Kind `trajectory`: camera poses that override the sequence's own."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

from scenewright.schemas.artifact import Artifact, OptionalDocument
from scenewright.schemas.base import Model
from scenewright.schemas.sequence import Gravity


class FrameEstimate(Model):
    """What is known of one frame of the main camera."""

    frame: int
    """Index in the sequence."""
    time: float
    status: Literal["key", "tracked", "interpolated", "unposed"]
    """Key frames stand in the pose graph; tracked ones hang on one; interpolated ones lie between two neighbours."""
    fault: str = ""
    """Why it has no pose (`no_depth`, `not_joined`, `not_registered`, `contradicted`), or `lost`: tracking began anew
    here."""
    confidence: float = 0.0
    """How well it agrees with what it was aligned with, 0 to 1."""
    uncertainty: float | None = None
    """Standard deviation of the position along an axis, beside the first frame [m]; None when not estimated."""


class LoopClosure(Model):
    """Two key frames that see the same place and are no neighbours."""

    first: int
    """Frame, index in the sequence."""
    second: int
    found_by: Literal["place", "overlap"]
    """By how they look, or by where they should be."""
    weight: float
    """How much the pose graph believed it, 0 to 1."""
    overlap: float
    """Share of one frame that lies on the surface of the other."""
    odometry_error: float | None = None
    """Distance by which odometry alone missed it [m]; None across a loss of tracking."""
    path_length: float | None = None
    """Way between the two by odometry [m]."""


class PosesFile(Model):
    """poses.json: how the poses were estimated, and how far they are to be believed."""

    method: Literal["rgbd", "refine", "sfm"]
    camera: str
    """Camera whose poses these are; frames of other cameras have none."""
    gravity: Gravity
    """How the world was made: `world_from_log` took the first key frame's coordinates into it."""
    world: Literal["upright", "sequence", "first"]
    frames: tuple[FrameEstimate, ...]
    loops: tuple[LoopClosure, ...] = ()
    drift: float | None = None
    """Median over believed loops of odometry error per way [m/m]: what the path would drift without loops."""
    variance_factor: float | None = None
    """Squared error of the pose graph per degree of freedom: far above 1, its edges contradict each other."""
    parts: int = 1
    """Stretches that nothing joined; only the largest has poses."""
    path_length: float = 0.0
    """Way of the camera over posed frames [m]."""


class Trajectory(Artifact):
    """`trajectory.tum`: one line a frame, `t tx ty tz qx qy qz qw`, world_from_camera.

    Estimated ones have `poses.json`; a trajectory from elsewhere, which is a folder with `trajectory.tum` alone or the
    file itself, has none, and its world is nobody's (stages/kit/own_trajectory.py).
    """

    outside: ClassVar[str] = "trajectory.tum"
    kind: ClassVar[str] = "trajectory"
    description: ClassVar[str] = "camera trajectory (TUM format, world_from_camera)"
    info = OptionalDocument(PosesFile, "poses.json")

    def path(self, name: str) -> Path:
        """Return the path of a payload file; the file itself where it was given alone."""
        return self.root if name == self.outside and self.root.is_file() else super().path(name)

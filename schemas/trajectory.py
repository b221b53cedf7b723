"""Kind `trajectory`: camera poses that override the sequence's own."""

from __future__ import annotations

from typing import ClassVar

from schemas.artifact import Artifact


class Trajectory(Artifact):
    """`trajectory.tum`: one line a frame, `t tx ty tz qx qy qz qw`, world_from_camera."""

    kind: ClassVar[str] = "trajectory"
    description: ClassVar[str] = "camera trajectory (TUM format, world_from_camera)"


class Depth(Artifact):
    """`depth.mcap`: depth that overrides the sequence's own, with confidence."""

    kind: ClassVar[str] = "depth"
    description: ClassVar[str] = "depth images and confidence computed from stereo"

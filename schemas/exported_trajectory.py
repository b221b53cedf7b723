"""Kind `exported_trajectory`: the motions of a plan as joint trajectories for other software."""

from __future__ import annotations

from typing import ClassVar

from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model

STATEMENT = "planned in simulation; not run on hardware"


class ExportedMotion(Model):
    """One action of the plan as a trajectory."""

    name: str
    """`pick(cup_5)`."""
    file: str
    """YAML of the message, relative to this folder."""
    start: float
    """Since the first action began [s]."""
    seconds: float
    points: int
    stretch: float
    """By how much the planned times were stretched, so that what a controller interpolates keeps the limits too; at
    least 1."""
    top_speed: float
    """Highest share of a joint's speed limit, between points too."""
    top_acceleration: float
    """Highest share of an arm joint's acceleration limit, between points too."""
    base_moves: bool
    """Whether the base drives meanwhile: the message holds arm and fingers alone."""


class TrajectoryExportFile(Model):
    """export.json: what was written, and within which limits."""

    statement: str
    robot: str
    joints: tuple[str, ...]
    """Of arm and fingers, in the order of the messages."""
    speeds: tuple[float, ...]
    """Limit of each joint [rad/s, m/s]."""
    acceleration: float
    """Limit of the arm's joints [rad/s^2]."""
    motions: tuple[ExportedMotion, ...]


class ExportedTrajectory(Artifact):
    """`export.json`, `trajectory.csv`, `trajectory.mcap` (trajectory_msgs/JointTrajectory, nav_msgs/Path), and
    `motions/<k>_<action>.yaml`."""

    kind: ClassVar[str] = "exported_trajectory"
    description: ClassVar[str] = "a plan's motions as ROS 2 joint trajectories and CSV"
    info = Document(TrajectoryExportFile, "export.json")

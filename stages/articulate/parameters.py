"""Declaration of `scenewright articulate`."""

from __future__ import annotations

from pydantic import Field
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.stage import Optionally, Parameters, Stage


class ArticulateParameters(Parameters):
    """Options of `articulate`."""

    voxel_size: float = Field(0.03, ge=0.01, le=0.2, description="Voxel edge of the change detection [m]")
    every: int = Field(1, ge=1, description="Use every n-th frame")
    maximum_depth: float = Field(4.0, gt=0.5, description="Maximum depth [m]")
    frames_seen: int = Field(
        3, ge=1, le=100, description="Frames by which one state of a voxel (occupied or free) must outvote the other"
    )
    pose_tolerance: float = Field(
        0.02, ge=0, description="Largest time difference between a pose of --trajectory and its frame [s]"
    )
    minimum_overlap: float = Field(
        0.7,
        gt=0,
        le=1,
        description="Least overlap of the part before and after, once moved by the joint (both ways, 0 to 1)",
    )


STAGE = Stage(
    name="articulate",
    summary="Find doors and drawers that a log shows in two states, and the joint of each from its motion",
    parameters=ArticulateParameters,
    reads={"sequence": Sequence, "trajectory": Optionally(Trajectory)},
    writes=Articulations,
    libraries=("numpy", "numba", "scipy"),
    example="scenewright articulate --sequence outputs/demo/sequence --out outputs/demo/articulations",
)

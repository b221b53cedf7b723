"""Declaration of `scenewright articulate`."""

from __future__ import annotations

from pydantic import Field
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.stage import Optionally, Parameters, Stage


class ArticulateParameters(Parameters):
    """Options of `articulate`."""

    voxel_size: float = Field(0.03, ge=0.01, le=0.2, description="Edge of the voxels that are watched [m]")
    every: int = Field(1, ge=1, description="Use every how many-th frame")
    maximum_depth: float = Field(4.0, gt=0.5, description="Farther depth is not used [m]")
    frames_seen: int = Field(
        3, ge=1, le=100, description="A voxel is full, or empty, when so many more frames say so than the opposite"
    )
    pose_tolerance: float = Field(
        0.02, ge=0, description="A pose of --trajectory belongs to the frame at most this far from its time [s]"
    )
    minimum_overlap: float = Field(
        0.7,
        gt=0,
        le=1,
        description="A joint is believed when this share of what was left lies where something came, when it is moved, "
        "and this share of what came lay where something was",
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

"""Declarations of the steps `splat build` and `splat render`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.sequence import Sequence
from schemas.splat import Splat, SplatViews
from schemas.trajectory import Trajectory
from stages.kit.stage import Optionally, Parameters, Stage

LIBRARIES = ("numpy", "numba", "scipy", "opencv-python-headless", "pillow")


class BuildParameters(Parameters):
    """Options of `splat build`. Rates of learning and of density belong to the method: stages/splat/methods."""

    method: Literal["ours", "thesis"] = Field("ours", description="Who sets, moves and removes Gaussians")
    width: int = Field(320, ge=16, le=4096, description="Pictures are learned at most so wide [px]")
    most_views: int = Field(200, ge=0, le=100_000, description="At most so many pictures, evenly spread; 0: all")
    hold_out_every: int = Field(0, ge=0, le=1000, description="Every so many-th picture is kept from learning; 0: none")
    steps_per_second: float = Field(
        20.0,
        ge=0.0,
        le=10_000.0,
        description="Steps of training in a second of the log: pictures arrive by their stamps",
    )
    steps: int = Field(1000, ge=0, le=1_000_000, description="Steps after the last picture has arrived")
    most_gaussians: int = Field(
        500_000, ge=1, le=10_000_000, description="New pictures bring no further Gaussians once there are so many"
    )
    refine_poses: bool = Field(False, description="Learn the poses too, but for the first")


class RenderParameters(Parameters):
    """Options of `splat render`."""

    views: Literal["held_out", "learned", "all"] = Field("held_out", description="Which pictures are compared")
    pictures: int = Field(12, ge=0, le=10_000, description="At most so many are written, evenly spread")


BUILD = Stage(
    name="splat build",
    version=2,
    summary="Learn a room as 3-D Gaussians from posed pictures that arrive one after another",
    parameters=BuildParameters,
    reads={"sequence": Sequence, "trajectory": Optionally(Trajectory)},
    writes=Splat,
    libraries=LIBRARIES,
    module="build_stage",
    example="scenewright splat build --sequence outputs/demo/sequence --hold-out-every 8 --out outputs/demo/splat",
)
RENDER = Stage(
    name="splat render",
    version=1,
    summary="Show what a splat shows where the camera stood, beside what the camera saw",
    parameters=RenderParameters,
    reads={"splat": Splat, "sequence": Sequence},
    writes=SplatViews,
    libraries=LIBRARIES,
    module="render_stage",
    example="scenewright splat render --splat outputs/demo/splat --sequence outputs/demo/sequence --out outputs/views",
)
STAGES = (BUILD, RENDER)

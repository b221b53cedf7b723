"""Options of `synthesize`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.errors import UsageError
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.stages.kit.estimates import LOG_MEGABYTES_PER_MEGAPIXEL, Estimate, Inputs
from scenewright.stages.kit.stage import Parameters, Stage

OTHER_ROOM = "take another --seed or a lower --clutter"
"""What helps where a room cannot be furnished, or a camera not be moved through it."""


class SynthesizeParameters(Parameters):
    """How the room is made and recorded. The room itself depends on the recipe, the clutter and the seed alone."""

    recipe: str = Field("room", pattern=r"^[a-z][a-z0-9_]*$", description="Room recipe, a file of data/recipes")
    clutter: Literal["none", "low", "medium", "high"] = Field("medium", description="How much lies about")
    frames: int = Field(300, ge=2, le=20000, description="Frames, spread evenly over the walk")
    width: int = Field(640, ge=32, le=4096, description="Image width [px]")
    height: int = Field(480, ge=32, le=4096, description="Image height [px]")
    field_of_view: float = Field(62.7, ge=20, le=120, description="Horizontal field of view [deg]")
    rate: float = Field(30.0, gt=0, le=1000, description="Frame rate of the sensor; times are multiples of 1/rate [Hz]")
    walking_speed: float = Field(0.5, gt=0.05, le=2.0, description="Speed between the places that are looked at [m/s]")
    depth_noise: bool = Field(True, description="Depth as a structured-light camera reports it; off: exact")
    stereo_baseline: float = Field(
        0.0, ge=0, le=0.5, description="Record a right eye at this distance along the camera's x too [m]; 0: none"
    )
    cameras: int = Field(
        1,
        ge=1,
        le=3,
        description="Frames are, in turn, of a camera ahead, one turned to the left and one to the right; "
        "`ingest --camera all` reads them all",
    )
    depth: bool = Field(True, description="The log holds depth; off: a stereo camera's log, for the step disparity")
    path: Literal["tour", "line", "loop", "eight"] = Field(
        "tour",
        description="A person's tour past everything, or a robot's drive that looks ahead: along a line, a loop, a "
        "figure of eight",
    )
    rounds: int = Field(1, ge=1, le=2, description="Rounds of a drive; the second with a lower camera, a line back")
    rearranged: int = Field(
        0, ge=0, le=1000, description="The same furniture with other things on it, elsewhere: which draw; 0: as it was"
    )
    rescaled: float = Field(
        0.0, ge=0, le=0.3, description="Largest share by which a thing is larger or smaller than its model"
    )
    opened: int = Field(
        0,
        ge=0,
        le=50,
        description="So many doors and drawers, one a thing, are opened or shut half-way, "
        "and the walk is gone there and back",
    )
    picture_noise: float = Field(
        0.0, ge=0, le=30, description="Standard deviation of the noise of every pixel of the images [of 255]"
    )


def check(parameters: SynthesizeParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for a log that would say nothing of distance, and for rounds of a tour."""
    if parameters.rounds > 1 and parameters.path == "tour":
        raise UsageError("a tour has no rounds", hint="give --path line, loop or eight")
    if not parameters.depth and parameters.stereo_baseline == 0:
        raise UsageError(
            "--no-depth leaves a log without distances",
            hint="give --stereo-baseline 0.12, for example, or leave --no-depth out",
        )


def _estimate(parameters: SynthesizeParameters, inputs: Inputs) -> Estimate:
    megapixels = parameters.frames * parameters.width * parameters.height / 1e6
    log = LOG_MEGABYTES_PER_MEGAPIXEL * megapixels
    return Estimate(15 + log, 5 + 0.5 * log, 850, parameters.frames, megapixels)


STAGE = Stage(
    name="synthesize",
    summary="Make a room by support rules and record it with a simulated RGB-D camera, with all ground truth",
    parameters=SynthesizeParameters,
    reads={"library": CadLibrary},
    writes=GroundTruth,
    libraries=("open3d", "numba", "numpy", "opencv-python-headless", "trimesh", "python-fcl", "scipy"),
    data_files=lambda parameters: (f"recipes/{parameters.recipe}.toml",),
    check=check,
    example="scenewright synthesize --library outputs/demo/cad_library --out outputs/demo/ground_truth --frames 300",
    estimate=_estimate,
)

"""Declaration of `scenewright poses`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage


class PosesParameters(Parameters):
    """Options of `poses`."""

    method: Literal["rgbd", "refine", "sfm"] = Field(
        "rgbd",
        description="`rgbd`: dense RGB-D odometry, loops and a pose graph; `refine`: the same with the motions of the "
        "sequence's own poses (a phone's, which drift) in the place of odometry, where the depth does not deny them; "
        "`sfm`: structure from motion on features (pycolmap), scaled by the depth",
    )
    loop_closure: bool = Field(True, description="`rgbd`: recognise places and optimise the pose graph; off: odometry")
    bundle_adjustment: bool = Field(
        False, description="`rgbd`: adjust key frames and features together at the end (pycolmap)"
    )
    use_color: bool = Field(True, description="`rgbd`: use colour where there is any; off: depth alone")
    world: Literal["auto", "upright", "sequence", "first"] = Field(
        "auto",
        description="World of the result: `sequence`: laid onto the poses that the sequence has; `upright`: z up, from "
        "the floor or the cameras' mean up; `first`: the first camera; `auto`: `sequence` where it has poses, else "
        "`upright`",
    )
    width: int = Field(320, ge=80, le=1280, description="Frames are halved until they are at most so wide [px]")
    maximum_depth: float = Field(4.5, gt=0.2, description="Farther depth is not used [m]")

    minimum_overlap: float = Field(
        0.3, gt=0, le=1, description="An alignment is believed when this share of a frame lies on the other's surface"
    )
    minimum_agreement: float = Field(
        0.75, gt=0, le=1, description="... and this share of what should be seen is (the rest floats in front of it)"
    )
    maximum_residual: float = Field(0.03, gt=0, description="... and the distance to its planes is at most this [m]")
    maximum_uncertainty: float = Field(
        0.05, gt=0, description="... and its worst direction is known within this [m]; blank walls are not"
    )
    maximum_brightness_difference: float = Field(
        0.1, gt=0, le=1, description="... and the brightness differs by at most this share of the range (rms)"
    )
    key_overlap: float = Field(0.75, gt=0, le=1, description="A key frame is made when the overlap falls below this")
    key_angle: float = Field(0.3, gt=0, le=1.5, description="... or the turn exceeds this [rad]")
    key_distance: float = Field(0.15, gt=0, description="... or the way exceeds this share of the median depth")

    loop_gap: int = Field(4, ge=2, description="Key frames nearer than this in order are no loop")
    loop_candidates: int = Field(3, ge=0, le=50, description="Places that look alike and are tried, per key frame")
    overlap_candidates: int = Field(
        2, ge=0, le=50, description="Key frames that should see the same and are linked, per key frame and round"
    )
    overlap_rounds: int = Field(2, ge=0, le=10, description="How often linking and optimising is repeated")

    sfm_frames: int = Field(
        250, ge=3, le=5000, description="`sfm`: at most so many frames, spread evenly; those between are interpolated"
    )
    sfm_neighbours: int = Field(8, ge=1, le=100, description="`sfm`: each frame is matched with so many that follow")


def check(parameters: PosesParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for options that do not go together."""
    if parameters.bundle_adjustment and not parameters.use_color:
        raise UsageError("--bundle-adjustment needs colour", hint="leave --no-use-color out")
    if parameters.method == "sfm" and not parameters.use_color:
        raise UsageError("--method sfm needs colour", hint="leave --no-use-color out, or use --method rgbd")
    if "features" in inputs and (parameters.method == "sfm" or not parameters.use_color):
        raise UsageError("--features needs colour, and --method rgbd or refine", hint="leave --features out")


STAGE = Stage(
    name="poses",
    summary="Estimate the camera's path of an RGB-D log: odometry, loop closure, pose graph",
    parameters=PosesParameters,
    reads={
        "sequence": Sequence,
        "features": Optionally(
            External(
                "Network that finds corners by which places are recognised and registered: xfeat (see `scenewright "
                "models`), or its file (.onnx); without it ORB does",
                weights=True,
            )
        ),
    },
    writes=Trajectory,
    libraries=("numpy", "numba", "scipy", "opencv-python-headless", "pycolmap"),
    check=check,
    example="scenewright poses --sequence outputs/demo/sequence --out outputs/demo/trajectory",
)

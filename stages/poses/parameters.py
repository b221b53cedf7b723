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
        description="`rgbd`: dense RGB-D odometry, loop closures, pose graph; `refine`: the same from the "
        "sequence's own poses; `sfm`: structure from motion (pycolmap), scaled by depth",
    )
    loop_closure: bool = Field(
        True, description="`rgbd`: loop closures and pose graph optimisation; off: odometry alone"
    )
    bundle_adjustment: bool = Field(
        False, description="`rgbd`: bundle adjustment over key frames at the end (pycolmap)"
    )
    use_color: bool = Field(True, description="`rgbd`: photometric residuals where there is colour; off: depth alone")
    world: Literal["auto", "upright", "sequence", "first"] = Field(
        "auto",
        description="World frame: `sequence`: aligned to the sequence's poses; `upright`: z up, from floor or "
        "mean camera up; `first`: the first camera; `auto`: `sequence` with poses, else `upright`",
    )
    width: int = Field(320, ge=80, le=1280, description="Frames are downsampled by halves to at most this width [px]")
    maximum_depth: float = Field(4.5, gt=0.2, description="Maximum depth [m]")

    minimum_overlap: float = Field(0.3, gt=0, le=1, description="Alignment: least overlap of the two frames")
    minimum_agreement: float = Field(
        0.75, gt=0, le=1, description="Alignment: least share of visible surface that agrees (the rest floats in front)"
    )
    maximum_residual: float = Field(0.03, gt=0, description="Alignment: largest point-to-plane error [m]")
    maximum_uncertainty: float = Field(
        0.05, gt=0, description="Alignment: largest uncertainty along its worst direction [m]"
    )
    maximum_brightness_difference: float = Field(
        0.1, gt=0, le=1, description="Alignment: largest RMS photometric error, as a share of the range"
    )
    key_overlap: float = Field(0.75, gt=0, le=1, description="Key frames: overlap below which a new one is made")
    key_angle: float = Field(0.3, gt=0, le=1.5, description="Key frames: rotation above which a new one is made [rad]")
    key_distance: float = Field(
        0.15, gt=0, description="Key frames: translation above which a new one is made, as a share of the median depth"
    )

    loop_gap: int = Field(4, ge=2, description="Loop closures: least key frames between the two")
    loop_candidates: int = Field(
        3, ge=0, le=50, description="Loop closures: candidates by place recognition per key frame"
    )
    overlap_candidates: int = Field(
        2, ge=0, le=50, description="Links to overlapping key frames, per key frame and round"
    )
    overlap_rounds: int = Field(2, ge=0, le=10, description="Rounds of linking and optimisation")

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

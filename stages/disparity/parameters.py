"""Declaration of the step `disparity`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.disparity import Disparity
from scenewright.schemas.errors import UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

NETWORKS = ("raft-stereo",)
"""Methods that are networks: they need weights, and torch."""


class DisparityParameters(Parameters):
    """Options of `disparity`."""

    method: Literal["semi-global", "raft-stereo"] = Field(
        "semi-global",
        description="`semi-global`: semi-global matching, needs no weights; `raft-stereo`: the network of that name, "
        "with --weights",
    )
    effort: Literal["low", "medium", "high"] = Field(
        "medium", description="`semi-global`: number of aggregation paths (3, 4, 8)"
    )
    block_size: int = Field(3, ge=1, le=11, description="`semi-global`: block size, odd [px]")
    agreement: float = Field(
        1.0, gt=0, le=16, description="Left-right consistency: largest difference of the two disparities [px]"
    )
    refine: bool = Field(
        True, description="`semi-global`: subpixel refinement: undo pixel locking and smooth within surfaces"
    )
    lowest_disparity: int | None = Field(
        None, ge=0, le=4096, description="Lowest disparity searched [px]; default: as every pair needs"
    )
    levels: int | None = Field(
        None, ge=16, le=4096, description="Number of disparities searched, a multiple of 16; with lowest_disparity"
    )
    iterations: int | None = Field(
        None, ge=1, le=128, description="`raft-stereo`: iterations; default: 32, of our small network 5"
    )
    minimum_confidence: float = Field(0.3, ge=0, le=1, description="Minimum confidence of depth")
    maximum_depth: float = Field(20.0, gt=0, le=65.0, description="Maximum depth [m]")
    rectification: Literal["correct", "report", "refuse"] = Field(
        "correct",
        description="Where epipolar lines are not the rows: `correct` rotates the right camera, `report` "
        "warns and goes on, `refuse` stops",
    )
    largest_row_error: float = Field(
        0.5, gt=0, le=20, description="Largest median row difference of matched features in a rectified pair [px]"
    )


def check_inputs(parameters: DisparityParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for options and inputs that do not go together."""
    has_weights = inputs.get("weights") is not None
    network = parameters.method in NETWORKS
    if network and not has_weights:
        raise UsageError(
            f"--method {parameters.method} needs --weights",
            hint="the authors' raftstereo-*.pth, or the .safetensors made of it",
        )
    if has_weights and not network:
        raise UsageError(f"--method {parameters.method} reads no --weights", hint=f"--method {' or '.join(NETWORKS)}")
    if (parameters.lowest_disparity is None) != (parameters.levels is None):
        raise UsageError("--lowest-disparity and --levels go together", hint="give both, or neither")
    if parameters.levels is not None and parameters.levels % 16:
        raise UsageError(f"--levels {parameters.levels} is not a multiple of 16", hint="the matcher needs one")
    if parameters.block_size % 2 == 0:
        raise UsageError(f"--block-size {parameters.block_size} is even", hint="give an odd one")


STAGE = Stage(
    name="disparity",
    summary="Match the stereo pairs of a sequence: disparity, confidence, and the depth that the other steps read",
    parameters=DisparityParameters,
    reads={
        "sequence": Sequence,
        "weights": Optionally(
            External("checkpoint of RAFT-Stereo: the authors' .pth, or .safetensors made of it", weights=True)
        ),
    },
    writes=Disparity,
    libraries=("numpy", "opencv-python-headless", "zstandard"),
    versions="versions",
    check=check_inputs,
    example="scenewright disparity --sequence outputs/pair/sequence --out outputs/pair/disparity",
)

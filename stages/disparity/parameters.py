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
        "medium", description="`semi-global`: directions that costs are gathered along (3, 4, 8)"
    )
    block_size: int = Field(3, ge=1, le=11, description="`semi-global`: odd width of the compared squares [px]")
    agreement: float = Field(
        1.0, gt=0, le=16, description="Matches from left to right and back may differ by this much [px]"
    )
    refine: bool = Field(True, description="`semi-global`: undo the pull to whole pixels and smooth within surfaces")
    lowest_disparity: int | None = Field(
        None, ge=0, le=4096, description="Disparities from here on are searched [px]; default: as every pair needs"
    )
    levels: int | None = Field(
        None, ge=16, le=4096, description="So many disparities are searched, a multiple of 16; with lowest_disparity"
    )
    iterations: int | None = Field(
        None, ge=1, le=128, description="`raft-stereo`: updates of the disparity; default: 32, of our small network 5"
    )
    minimum_confidence: float = Field(0.3, ge=0, le=1, description="Less confident disparities give no depth")
    maximum_depth: float = Field(20.0, gt=0, le=65.0, description="Farther depth is left out [m]")
    rectification: Literal["correct", "report", "refuse"] = Field(
        "correct",
        description="When matched features lie in different rows: `correct` turns the right eye back where a small "
        "turn explains it, `report` says so and goes on, `refuse` stops",
    )
    largest_row_error: float = Field(
        0.5,
        gt=0,
        le=20,
        description="Matched features of a rectified pair lie at most so many rows apart (median) [px]",
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
        raise UsageError(f"--levels {parameters.levels} is no multiple of 16", hint="the matcher needs one")
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

"""Declaration of the step `pack`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.packing import Packing
from scenewright.stages.kit.language.options import LanguageParameters
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT, robot_files, robot_option
from scenewright.stages.kit.stage import External, Optionally, Stage

Suite = Literal[
    "published/easy",
    "published/medium",
    "published/hard",
    "published/hard_medium_basket",
    "published/hard_large_basket",
    "hard/fill",
    "hard/unreachable",
    "hard/obstacles",
    "hard/mixed_heights",
    "hard/boxes_6",
    "hard/boxes_8",
    "hard/boxes_10",
]
ProposerName = Literal[
    "ours",
    "backtrack",
    "scratch",
    "symbolic",
    "random",
    "random_restarts",
    "backtracking",
    "backtracking_corners",
    "fixed_layout",
]
LANGUAGE_PROPOSERS = ("backtrack", "scratch", "symbolic")


class PackParameters(LanguageParameters):
    """Options of `pack`. Budgets count calls, never seconds."""

    suite: Suite = Field("published/easy", description="Where the problem comes from; --problem replaces it")
    instance: int = Field(0, ge=0, le=2**31, description="Number of the problem in the suite: its seed")
    proposer: ProposerName = Field(
        "ours",
        description="Who proposes plans: `ours` (geometry and feedback); a language model: `backtrack`, "
        "`scratch` (LLM3) or `symbolic` (its order, our geometry); or samplers without feedback",
    )
    reasons: bool = Field(True, description="The proposer sees why an action failed, not only that it did")
    trace_length: int = Field(5, ge=1, le=100, description="Attempts that a language model is shown (k)")
    iterations: int = Field(20, ge=1, le=1_000_000, description="Plans proposed at most")
    motion_calls: int = Field(20_000, ge=1, le=10_000_000, description="Motion-planner calls at most")
    robot: str = robot_option("it is bolted down at the origin")
    limits: Literal["fr3", "panda"] = Field(
        "fr3", description="Joint limits of the Panda: as published for LLM3, or its own; other robots have their own"
    )
    image_width: int = Field(900, ge=200, le=4000, description="Width of the pictures [px]")


def check_inputs(parameters: PackParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError when a transcript is given that nobody reads, and for limits of another robot."""
    if parameters.robot != USUAL_ROBOT and parameters.limits != "fr3":
        raise UsageError(
            f"--limits {parameters.limits} are the Panda's, not those of --robot {parameters.robot}",
            hint="leave --limits out: its description says its own",
        )
    if inputs.get("transcript") is not None and parameters.proposer not in LANGUAGE_PROPOSERS:
        raise UsageError(
            f"--proposer {parameters.proposer} reads no --transcript",
            hint=f"proposers that ask a language model: {', '.join(LANGUAGE_PROPOSERS)}",
        )


STAGE = Stage(
    name="pack",
    summary="Pack boxes into a basket with an arm: plans are proposed, motion planning says what is wrong (LLM3)",
    parameters=PackParameters,
    reads={
        "problem": Optionally(External("a packing problem of your own, JSON (docs/LLM3.md)")),
        "transcript": Optionally(External("transcript.jsonl of an earlier run, for --language recorded or openai")),
    },
    writes=Packing,
    libraries=("numpy", "scipy", "numba", "ompl", "pybullet", "trimesh", "matplotlib"),
    data_files=lambda parameters: robot_files(parameters.robot),
    check=check_inputs,
    example="scenewright pack --suite hard/unreachable --instance 3 --proposer ours --out outputs/pack",
)

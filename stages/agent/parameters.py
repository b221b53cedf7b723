"""Declarations of the steps `agent run`, `agent replay` and `agent evaluate`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.agent_episode import AgentEpisode, AgentEvaluation
from scenewright.schemas.errors import UsageError
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.kit.acting.errors import RATES_NAME
from scenewright.stages.kit.acting.eyes.options import SegmenterParameters
from scenewright.stages.kit.language.options import LanguageParameters
from scenewright.stages.kit.simulation.robot_option import check_robot_acts, robot_files, robot_option
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

ArmName = Literal["open_loop", "bool_feedback", "thesis", "ours", "oracle"]
RECIPE, SHAPES = "agent/apartment.toml", "agent/things.toml"


class RunParameters(LanguageParameters, SegmenterParameters):
    """Options of `agent run`. The apartment follows from the task and --seed, or is --world."""

    task: str = Field("place_fruit", description="Name of a built-in task, or what you want in words (docs/AGENT.md)")
    arm: ArmName = Field("ours", description="How calls are carried out and checked; only `oracle` sees without errors")
    brain: Literal["rules", "language"] = Field(
        "rules", description="Who writes the programs: rules of ours, no model; or a language model (--language)"
    )
    simulation: Literal["fast", "physics"] = Field(
        "fast", description="Without contact, failures at given rates; or pybullet with rendered cameras (no doors)"
    )
    robot: str = robot_option("in physics, and one that drives")
    failures: float = Field(1.0, ge=0, le=10, description="Factor of the rates at which executions fail")
    perception: float = Field(1.0, ge=0, le=10, description="Factor of the rates at which the eyes err")
    turns: int = Field(150, ge=1, le=1000, description="Programs at most")
    image_width: int = Field(1200, ge=300, le=4000, description="Width of the picture [px]")


class ReplayParameters(SegmenterParameters):
    """Options of `agent replay`."""

    robot: str = robot_option("the one that did the episode")
    image_width: int = Field(1200, ge=300, le=4000, description="Width of the picture [px]")


class EvaluateParameters(Parameters):
    """Options of `agent evaluate`. The trials have seeds `first_seed` and up, the same for all arms."""

    tasks: tuple[str, ...] = Field(("place_fruit", "move_toy"), description="Built-in tasks")
    arms: tuple[str, ...] = Field(("open_loop", "bool_feedback", "thesis", "ours", "oracle"), description="Arms")
    trials: int = Field(20, ge=1, le=2000, description="Seeds of each task")
    first_seed: int = Field(0, ge=0, le=2**31, description="The first of them")
    failures: float = Field(1.0, ge=0, le=10, description="Factor of the rates at which executions fail")
    perception: float = Field(1.0, ge=0, le=10, description="Factor of the rates at which the eyes err")


def check_run(parameters: RunParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for options that do not go together."""
    if not parameters.task.strip():
        raise UsageError("--task is empty", hint="say what you want, or name a built-in task")
    if inputs.get("scene") is not None and inputs.get("truth") is None:
        raise UsageError("--scene is what the robot knows of a room", hint="give --truth, the room it is in, too")
    if inputs.get("truth") is not None and inputs.get("world") is not None:
        raise UsageError("--world and --truth are two rooms", hint="give one of them")
    acts = parameters.simulation == "physics"
    check_robot_acts(parameters, acts=acts, without="the fast world has no arm", hint="give --simulation physics too")
    if parameters.segmenter and parameters.simulation != "physics":
        raise UsageError("--segmenter: nothing takes images in the fast world", hint="give --simulation physics too")
    if parameters.segmenter and (parameters.arm == "oracle" or parameters.perception != 1.0):
        raise UsageError(
            "--segmenter errs as it does: --arm oracle and --perception say how a simulated one errs",
            hint="leave one of them out",
        )
    if parameters.brain == "rules" and (inputs.get("transcript") is not None or parameters.language != "scripted"):
        raise UsageError("--brain rules asks no language model", hint="give --brain language too")
    if parameters.brain == "language" and parameters.language == "scripted":
        raise UsageError("--brain language needs somebody to ask", hint="--language openai or recorded")


RUN = Stage(
    name="agent run",
    summary="Tell a mobile robot in words what to do in an apartment that it has never seen (COME-robot)",
    parameters=RunParameters,
    reads={
        "world": Optionally(External("an apartment of your own, JSON (docs/AGENT.md)")),
        "scene": Optionally(InteractiveScene),
        "truth": Optionally(GroundTruth),
        "transcript": Optionally(External("transcript.jsonl of an earlier run, for --language recorded or openai")),
    },
    writes=AgentEpisode,
    libraries=("numpy", "scipy", "numba", "matplotlib", "pybullet", "open3d", "trimesh"),
    module="run_stage",
    versions="segmenter_identity",
    data_files=lambda parameters: (
        (RECIPE, RATES_NAME, SHAPES, *robot_files(parameters.robot))
        if parameters.simulation == "physics"
        else (RECIPE, RATES_NAME)
    ),
    check=check_run,
    example='scenewright agent run --task "Put all the fruit onto the plate." --seed 3 --out outputs/agent/episode',
)
REPLAY = Stage(
    name="agent replay",
    summary="Do an episode again with the programs that its brain wrote: the same bytes, nobody is asked",
    parameters=ReplayParameters,
    reads={"episode": AgentEpisode, "truth": Optionally(GroundTruth)},
    writes=AgentEpisode,
    libraries=("numpy", "scipy", "numba", "matplotlib", "pybullet", "open3d", "trimesh"),
    module="replay_stage",
    versions="segmenter_identity",
    data_files=lambda parameters: (RECIPE, RATES_NAME, SHAPES, *robot_files(parameters.robot)),
    example="scenewright agent replay --episode outputs/agent/episode --out outputs/agent/again",
)
EVALUATE = Stage(
    name="agent evaluate",
    summary="Compare arms of the agent over tasks and seeds in the fast world",
    parameters=EvaluateParameters,
    reads={},
    writes=AgentEvaluation,
    libraries=("numpy", "scipy", "numba"),
    module="evaluate_stage",
    data_files=lambda parameters: (RECIPE, RATES_NAME, SHAPES),
    example="scenewright agent evaluate --trials 20 --out outputs/agent/evaluation",
)
STAGES = [RUN, REPLAY, EVALUATE]

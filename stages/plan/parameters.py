"""Declaration of the step `plan`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.language_map import LanguageMap
from scenewright.schemas.plan import Plan
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.acting.errors import RATES_NAME
from scenewright.stages.kit.acting.eyes.options import SegmenterParameters
from scenewright.stages.kit.estimates import grows_with
from scenewright.stages.kit.open_words.options import READING_FILES
from scenewright.stages.kit.simulation.robot_option import robot_files, robot_option
from scenewright.stages.kit.stage import External, Optionally, Stage

STAND = "--stand X --stand Y --stand YAW, in metres and degrees"


class PlanParameters(SegmenterParameters):
    """Options of `plan`. Budgets count attempts, never seconds."""

    goal: tuple[str, ...] = Field(
        (),
        description="Goal literals: on(bottle_7,table_3) closed(fridge_2), also not, every, any, formulas "
        "and, with --language, words (docs/PLANNING.md). Empty: take an item out of furniture, "
        "put it on a table, close the door",
    )
    task: Literal["", "fridge-to-microwave", "tidy-the-desk", "put-away-in-drawer", "stack-and-carry"] = Field(
        "", description="A task by name; its goal is derived from what is in the scene. Not together with --goal"
    )
    assume: tuple[str, ...] = Field(
        (),
        description="Named priors such as in(bottle,fridge_2): a thing of this class is believed to be there, hidden "
        "by closed furniture; its pose and shape are seen once the furniture is open",
    )
    robot: str = robot_option()
    stand: tuple[float, ...] = Field(
        (),
        description="Start pose of the base: x y [m] and yaw [deg]. Empty: the freest place, with --sequence "
        "among the camera's",
    )
    planner: Literal["builtin", "fast-downward"] = Field(
        "builtin", description="Task planner; fast-downward is a program of its own (extra planning-gpl)"
    )
    heuristic: Literal["landmarks", "add", "max", "ff"] = Field(
        "landmarks", description="Heuristic of the built-in task planner; max finds shortest plans, slowly"
    )
    execute: bool = Field(True, description="Execute the plan in physics: in the true room when it is given")
    relocalize: bool = Field(
        True,
        description="Before each action the robot sees pose and shape of the action's bodies in the room of "
        "execution; off: open loop",
    )
    eyes: Literal["true", "camera"] = Field(
        "true",
        description="What the robot sees: true poses; camera: poses and joint values estimated from rendered "
        "depth, with errors of segmenter, localisation and encoders",
    )
    match_radius: float = Field(
        0.5,
        gt=0,
        le=5,
        description="Largest distance of a planned body from the nearest of its class in the true room [m]",
    )
    clearance: float = Field(0.004, ge=0, le=0.05, description="Clearance from obstacles [m]")
    size_uncertainty: float = Field(
        0.02,
        ge=0,
        le=0.2,
        description="Largest reduction of an item's width for planning, as voxels widen thin things [m]; not "
        "of what was looked at",
    )
    base_samples: int = Field(240, ge=16, le=20000, description="Base poses drawn per query")
    pair_samples: int = Field(2500, ge=16, le=1_000_000, description="Pairs of base and tool pose tried per query")
    path_samples: int = Field(800, ge=16, le=1_000_000, description="Samples of one RRT-Connect search")
    path_searches: int = Field(8, ge=1, le=1000, description="Path searches per query")
    refinement_attempts: int = Field(3, ge=1, le=100, description="Tries of the motions of one task plan")
    task_attempts: int = Field(4, ge=1, le=100, description="Task plans tried, each without what failed before")
    execution_attempts: int = Field(3, ge=1, le=20, description="Tries of an action that fails in execution")
    replans: int = Field(
        2,
        ge=0,
        le=20,
        description="Replanning attempts after an action that failed in all its tries, or a goal that does not hold",
    )
    video_rate: float = Field(1.0, ge=0, le=30, description="Images per second in execution.mcap [1/s]; 0: none")
    image_width: int = Field(640, ge=64, le=4096, description="Width of the key frames [px]")


def plan_files(parameters: PlanParameters) -> tuple[str, ...]:
    """Return the files of `data/` that describe the robot, and what words need."""
    words = (*READING_FILES, "words/two_towers.safetensors", "words/calibration.toml")
    return (*robot_files(parameters.robot), RATES_NAME, *words)


def check_options(parameters: PlanParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for options that do not go together."""
    if parameters.goal and parameters.task:
        raise UsageError("--goal and --task cannot be given together", hint="leave one of them out")
    if parameters.stand and len(parameters.stand) != 3:
        raise UsageError(f"--stand has {len(parameters.stand)} values, not 3", hint=STAND)
    if parameters.eyes == "true" and (parameters.segmenter or parameters.segmenter_errors != "thesis"):
        raise UsageError("with --eyes true nothing is segmented", hint="give --eyes camera too")
    if inputs.get("domain") is not None and parameters.planner != "builtin":
        raise UsageError("--planner fast-downward plans in the scene's own domain", hint="leave --domain or it out")


STAGE = Stage(
    name="plan",
    summary="Plan what a robot does in the scene, execute it in physics, check the goal or say why not",
    parameters=PlanParameters,
    reads={
        "scene": InteractiveScene,
        "ground_truth": Optionally(GroundTruth),
        "domain": Optionally(External("operators to plan with: PDDL, or what `predicates teach --scene` wrote")),
        "language": Optionally(LanguageMap),
        "sequence": Optionally(Sequence),
    },
    writes=Plan,
    libraries=("numpy", "scipy", "numba", "ompl", "pybullet", "open3d", "trimesh"),
    versions="segmenter_identity",
    data_files=plan_files,
    check=check_options,
    example="scenewright plan --scene outputs/demo/interactive_scene --ground-truth outputs/demo/ground_truth "
    "--out outputs/demo/plan",
    estimate=grows_with("scene", 2.2, 0.0, 640, 0.0),
)

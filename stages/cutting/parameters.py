"""Declarations of the steps `cutting demonstrate`, `learn`, `plan`, `simulate` and `evaluate`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.cutting_demonstrations import CuttingDemonstrations
from scenewright.schemas.cutting_model import CuttingModel
from scenewright.schemas.cutting_plan import CuttingEvaluation, CuttingPlan, CuttingTrial
from scenewright.schemas.errors import UsageError
from scenewright.stages.cutting.words import read_words
from scenewright.stages.kit.known_names import check_names
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

MethodName = Literal["ours", "thesis", "bc", "qnet"]
METHODS: tuple[MethodName, ...] = ("ours", "thesis", "bc", "qnet")
CELL_NAMES = ("n1m1", "n1m2", "n2m1", "n2m2", "n2m3", "n3m4")
FoodName = Literal["bread", "carrot", "cheese", "cucumber", "potato", "sausage"]
LIBRARIES = ("numpy", "scipy", "numba", "trimesh", "manifold3d")


class DemonstrateParameters(Parameters):
    """Options of `cutting demonstrate`."""

    share: float = Field(1.0, gt=0.0, le=10.0, description="Of 110 trials; every cell keeps at least one")
    tilt: float = Field(0.07, ge=0.0, le=0.5, description="Scatter of a plane's angle [rad]")
    spacing: float = Field(0.12, ge=0.0, le=0.5, description="Scatter of a plane's place, over what it cuts off")
    image_width: int = Field(1200, ge=300, le=4000, description="Width of the picture [px]")


class LearnParameters(Parameters):
    """Options of `cutting learn`."""

    methods: tuple[str, ...] = Field(
        ("ours",), description="ours alone, or also thesis, bc, qnet, whose networks take a minute to train"
    )


class PlanParameters(Parameters):
    """Options of `cutting plan`."""

    method: MethodName = Field("ours", description="Who plans; the model must have learned it")
    goal: str = Field(
        "",
        description='What is wanted in words, e.g. "6 slices, 8 cubes"; else --goal-meshes, --goal-pictures, --trial',
    )
    trial: int = Field(0, ge=0, le=2000, description="Trial of --demonstrations whose objects and fragments are taken")
    food: FoodName = Field("carrot", description="What is cut without --mesh and --demonstrations, made from --seed")
    unit: Literal["m", "mm"] = Field("m", description="Unit of --mesh and --goal-meshes")
    together: bool = Field(False, description="One stroke may pass through several pieces; ours")
    image_width: int = Field(1200, ge=300, le=4000, description="Width of the pictures [px]")


class SimulateParameters(Parameters):
    """Options of `cutting simulate`."""

    method: MethodName = Field("ours", description="Who plans each cut from what lies on the board")
    cameras: bool = Field(False, description="Plan from what two depth cameras see of pieces laid apart; ours")
    image_width: int = Field(1200, ge=300, le=4000, description="Width of the pictures [px]")


class EvaluateParameters(Parameters):
    """Options of `cutting evaluate`. Goals are trials of seeds `first_goal` and up."""

    cells: tuple[str, ...] = Field(CELL_NAMES, description="Cells of the thesis's table")
    methods: tuple[str, ...] = Field(
        ("scatter", "ours"),
        description="scatter (the scripted cutter), what was learned, ours_perceived (by two depth cameras), "
        "ours_together (through several pieces at once)",
    )
    goals: int = Field(10, ge=1, le=1000, description="Goals in each cell")
    first_goal: int = Field(0, ge=0, le=2**31, description="Seed of the first goal")


def check_learn(parameters: LearnParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for an unknown method."""
    check_names("--methods", parameters.methods, METHODS)


def check_evaluate(parameters: EvaluateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for an unknown method or cell."""
    check_names("--methods", parameters.methods, ("scatter", *METHODS, "ours_perceived", "ours_together"))
    check_names("--cells", parameters.cells, CELL_NAMES)


def check_simulate(parameters: SimulateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for cameras with a method that does not look through them."""
    if parameters.cameras and parameters.method != "ours":
        raise UsageError(f"--cameras: {parameters.method} knows whole shapes", hint="--method ours")


def check_plan(parameters: PlanParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError unless there is one goal, and words that can be read."""
    given_inputs = [name for name in ("goal_meshes", "goal_pictures", "demonstrations") if inputs.get(name) is not None]
    goals = [f"--{name.replace('_', '-')}" for name in given_inputs if name.startswith("goal")]
    goals += ["--goal"] if parameters.goal else []
    if len(goals) > 1:
        raise UsageError(f"{' and '.join(goals)} both set the goal", hint="give one of them")
    if parameters.goal:
        read_words(parameters.goal)
        if parameters.method != "ours":
            raise UsageError(f"--method {parameters.method} plans for fragments, not for words", hint="--method ours")
    elif not given_inputs:
        raise UsageError(
            "cutting plan: nothing is wanted",
            hint='give --goal "6 slices", --goal-meshes, --goal-pictures or --demonstrations',
        )
    if parameters.together and parameters.method != "ours":
        raise UsageError(f"--together: {parameters.method} cuts one piece at a time", hint="--method ours")
    if "demonstrations" in given_inputs and inputs.get("mesh") is not None:
        raise UsageError("--mesh and --demonstrations both set the object", hint="give one of them")


DEMONSTRATE = Stage(
    name="cutting demonstrate",
    summary="Demonstrations: of a scripted cutter, who misses as people do, or what a person recorded",
    parameters=DemonstrateParameters,
    reads={"record": Optionally(External("what was cut by clicking on pictures (scenewright cutting record FILE)"))},
    writes=CuttingDemonstrations,
    libraries=(*LIBRARIES, "open3d", "pillow"),
    module="demonstrate_stage",
    example="scenewright cutting demonstrate --seed 1 --out outputs/cutting/demonstrations",
)
LEARN = Stage(
    name="cutting learn",
    summary="Learn types of fragments and rules of cutting from demonstrations",
    parameters=LearnParameters,
    reads={"demonstrations": CuttingDemonstrations},
    writes=CuttingModel,
    libraries=(*LIBRARIES, "torch"),
    module="learn_stage",
    check=check_learn,
    example="scenewright cutting learn --demonstrations outputs/cutting/demonstrations --out outputs/cutting/model",
)
PLAN = Stage(
    name="cutting plan",
    summary="Plan cuts towards fragments that are wanted, or say why that cannot be",
    parameters=PlanParameters,
    reads={
        "model": CuttingModel,
        "demonstrations": Optionally(CuttingDemonstrations),
        "mesh": Optionally(External("closed mesh of what is cut (PLY, OBJ, STL, GLB)")),
        "goal_meshes": Optionally(External("folder of closed meshes, the fragments that are wanted")),
        "goal_pictures": Optionally(External("folder of colour and depth pictures of the fragments that are wanted")),
    },
    writes=CuttingPlan,
    libraries=(*LIBRARIES, "torch", "open3d", "pillow"),
    module="plan_stage",
    check=check_plan,
    example='scenewright cutting plan --model outputs/cutting/model --goal "6 slices, 8 cubes" --out outputs/cut',
)
SIMULATE = Stage(
    name="cutting simulate",
    summary="Cut on a board in physics, planning anew after each cut from what lies there",
    parameters=SimulateParameters,
    reads={"plan": CuttingPlan, "model": CuttingModel},
    writes=CuttingTrial,
    libraries=(*LIBRARIES, "torch", "pybullet", "open3d", "pillow"),
    module="simulate_stage",
    check=check_simulate,
    example="scenewright cutting simulate --plan outputs/cutting/plan --model outputs/cutting/model "
    "--out outputs/cutting/trial",
)
EVALUATE = Stage(
    name="cutting evaluate",
    summary="Compare methods of cutting over many seeded goals, with intervals",
    parameters=EvaluateParameters,
    reads={"model": CuttingModel},
    writes=CuttingEvaluation,
    libraries=(*LIBRARIES, "torch"),
    module="evaluate_stage",
    check=check_evaluate,
    example="scenewright cutting evaluate --model outputs/cutting/model --goals 20 --out outputs/cutting/evaluation",
)
STAGES = [DEMONSTRATE, LEARN, PLAN, SIMULATE, EVALUATE]

"""Declarations of the steps `tableware scene`, `detect`, `plan`, `simulate` and `evaluate`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.tableware_detections import TablewareDetections
from scenewright.schemas.tableware_plan import TablewarePlan
from scenewright.schemas.tableware_scene import TablewareScene
from scenewright.schemas.tableware_trial import TablewareEvaluation, TablewareTrial
from scenewright.stages.kit.simulation.robot_option import check_robot_acts, robot_files, robot_option
from scenewright.stages.kit.stage import Optionally, Parameters, Stage
from scenewright.stages.tableware import policies
from scenewright.stages.tableware.detect_parameters import DETECT, DISHES_FILE
from scenewright.stages.tableware.found_by_place import names_in
from scenewright.stages.tableware.options import PHYSICS_TIMES, THESIS_TIMES, ActionTimes, PolicyName, TierName


class SceneParameters(Parameters):
    """Options of `tableware scene`. The table follows from tier and --seed."""

    tier: TierName = Field("tier1", description="The thesis's tiers 0 (of one kind), 1 and 2, and our cluttered tier 3")
    light: Literal["bright", "usual", "dim"] = Field("usual", description="Light, and noise of the camera")
    colors: Literal["dark_on_white", "white_on_dark"] = Field("dark_on_white", description="Dishes and table")


class PlanParameters(ActionTimes):
    """Options of `tableware plan`."""

    policy: PolicyName = Field("ours", description="Who decides; random_piles is Random as its tier-2 figure implies")
    source: Literal["image", "truth"] = Field(
        "image", description="Where the items of --scene come from: its image, looked at now, or its ground truth"
    )
    least_confidence: float = Field(
        0.5, ge=0.0, le=1.0, description="What was seen with less confidence is refused, left alone and kept clear of"
    )
    draws: int = Field(50, ge=1, le=1000, description="Draws of what chance decides behind the expected seconds")
    image_width: int = Field(1200, ge=300, le=4000, description="Width of the pictures [px]")


class SimulateParameters(ActionTimes):
    """Options of `tableware simulate`."""

    policy: PolicyName = Field("ours", description="Who decides, one action for each look at the table")
    simulator: Literal["fast", "physics"] = Field("fast", description="The fitted time model, or contact physics")
    robot: str = robot_option("in physics, where it stands beside the table", default="ur5_bench")
    sight: Literal["truth", "image"] = Field(
        "truth", description="What the policy sees before each action: everything, or a new rendered image"
    )
    least_confidence: float = Field(
        0.3, ge=0.0, le=1.0, description="With --sight image: what was seen with less confidence is left alone"
    )
    image_width: int = Field(1200, ge=300, le=4000, description="Width of the pictures [px]")


class EvaluateParameters(ActionTimes):
    """Options of `tableware evaluate`. The scenes have seeds `first_scene` and up."""

    tier: TierName = Field("tier1", description="Tier of the scenes; their times are those of --times-of")
    scenes: int = Field(20, ge=1, le=2000, description="Number of scenes")
    first_scene: int = Field(0, ge=0, le=2**31, description="Seed of the first scene")
    policies: tuple[str, ...] = Field(
        ("random", "random_piles", "stack", "pull", "ours", "ours_without_loaded_pulls"),
        description="Policies to compare",
    )
    draws: int = Field(20, ge=1, le=1000, description="Draws of what chance decides on each scene, the same for all")
    sight: Literal["truth", "image"] = Field(
        "truth", description="What the policies see; a rendered image before each action takes seconds"
    )
    least_confidence: float = Field(0.3, ge=0.0, le=1.0, description="As for simulate")


def check_plan(parameters: PlanParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError unless there is one thing to plan from."""
    if not inputs:
        raise UsageError("tableware plan: nothing to plan from", hint="give --detections, or --scene")
    if len(inputs) > 1:
        raise UsageError("tableware plan: --detections and --scene both say what is there", hint="give one of them")
    if "detections" in inputs and parameters.source == "truth":
        raise UsageError("--source truth is for --scene", hint="leave it out")


def check_simulate(parameters: SimulateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for options that exclude each other."""
    acts = parameters.simulator == "physics"
    check_robot_acts(parameters, acts=acts, without="the time model has no arm", hint="give --simulator physics too")
    if parameters.simulator == "physics" and parameters.delay > 0.0:
        raise UsageError("--delay belongs to the time model of --simulator fast", hint="leave it out for physics")
    if inputs.get("plan") is not None and parameters.sight == "image":
        raise UsageError("the actions of --plan are carried out without looking", hint="leave out --sight image")


def check_evaluate(parameters: EvaluateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for an unknown policy."""
    names = names_in(policies)
    for policy in parameters.policies:
        if policy not in names:
            raise UsageError(f"--policies: there is no policy {policy!r}", hint=f"choose one of {', '.join(names)}")


SCENE = Stage(
    name="tableware scene",
    summary="Make a seeded table with tableware and its overhead RGB-D image",
    parameters=SceneParameters,
    reads={"dishes": Optionally(DISHES_FILE)},
    writes=TablewareScene,
    libraries=("numpy", "trimesh", "embreex", "pillow"),
    module="scene_stage",
    example="scenewright tableware scene --tier tier2 --seed 3 --out outputs/tidy/scene",
)
PLAN = Stage(
    name="tableware plan",
    summary="Plan how to clear a table: pulls, stackings, multi-object and single grasps (TIDY)",
    parameters=PlanParameters,
    reads={"detections": Optionally(TablewareDetections), "scene": Optionally(TablewareScene)},
    writes=TablewarePlan,
    libraries=(
        "numpy",
        "scipy",
        "numba",
        "opencv-python-headless",
        "trimesh",
        "pillow",
        "rosbags",
        "mcap",
        "zstandard",
    ),
    module="plan_stage",
    data_files=lambda parameters: (THESIS_TIMES,),
    check=check_plan,
    example="scenewright tableware plan --detections outputs/tidy/detections --policy ours --out outputs/tidy/plan",
)
SIMULATE = Stage(
    name="tableware simulate",
    summary="Let a policy, or a plan, clear a table in the fast simulator or in physics",
    parameters=SimulateParameters,
    reads={"scene": TablewareScene, "plan": Optionally(TablewarePlan)},
    writes=TablewareTrial,
    libraries=("numpy", "numba", "pybullet", "trimesh", "embreex", "opencv-python-headless", "pillow"),
    module="simulate_stage",
    data_files=lambda parameters: (
        THESIS_TIMES,
        PHYSICS_TIMES,
        *(robot_files(parameters.robot) if parameters.simulator == "physics" else ()),
    ),
    check=check_simulate,
    example="scenewright tableware simulate --scene outputs/tidy/scene --policy ours --out outputs/tidy/trial",
)
EVALUATE = Stage(
    name="tableware evaluate",
    summary="Compare policies over many seeded tables in the fast simulator, with intervals",
    parameters=EvaluateParameters,
    reads={},
    writes=TablewareEvaluation,
    libraries=("numpy", "numba", "opencv-python-headless", "trimesh", "embreex"),
    module="evaluate_stage",
    data_files=lambda parameters: (THESIS_TIMES,),
    check=check_evaluate,
    example="scenewright tableware evaluate --tier tier2 --scenes 50 --out outputs/tidy/evaluation",
)
STAGES = [SCENE, DETECT, PLAN, SIMULATE, EVALUATE]

"""Declarations of the steps `predicates teach`, `plan` and `evaluate`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.kitchen_plan import KitchenEvaluation, KitchenPlan
from scenewright.schemas.learned_domain import LearnedDomain
from scenewright.stages.kit.known_names import check_names
from scenewright.stages.kit.language.options import LanguageParameters
from scenewright.stages.kit.simulation.robot_option import check_robot_acts, robot_files, robot_option
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

DomainName = Literal["store_objects", "set_table", "cook_meal"]
SetName = Literal["canonical", "more_objects", "novel_goals", "combined", "hundred_goals"]
SET_NAMES: tuple[SetName, ...] = ("canonical", "more_objects", "novel_goals", "combined", "hundred_goals")
LIBRARIES = ("numpy", "pymunk", "numba")
IN_ROOMS = "in rooms: what it reaches and how far its hand opens"


class TeachParameters(LanguageParameters):
    """Options of `predicates teach`."""

    domain: DomainName = Field("store_objects", description="Which kitchen")
    tasks: int = Field(10, ge=1, le=100, description="Training tasks")
    wording: Literal["plain", "diverse"] = Field("plain", description="One sentence for each thing amiss, or several")
    learner: Literal["ours", "thesis", "random"] = Field(
        "ours",
        description="Who learns: `thesis` asks a language model (--language; scripted is a stand-in, no model), "
        "`random` explores by chance",
    )
    teacher: Literal["simulated", "terminal"] = Field(
        "simulated", description="Who teaches: `terminal` asks you, and keeps what you say in teacher.jsonl"
    )
    wrong: float = Field(0.0, ge=0.0, le=0.5, description="Share of corrections that are wrong or missing")
    robot: str = robot_option(IN_ROOMS)


class PlanParameters(Parameters):
    """Options of `predicates plan`."""

    goal: str = Field(
        "", description='What is wanted, e.g. "stack bread on plate and put cup on the table"; else that of the task'
    )
    which: SetName = Field("combined", description="Set of tasks that the kitchen is taken from, without --tasks")
    task: int = Field(1, ge=1, le=1000, description="Which of them; of --tasks, counted through its files by path")
    planner: Literal["builtin", "fast-downward"] = Field(
        "builtin", description="Task planner; fast-downward is a program of its own (extra planning-gpl)"
    )
    image_width: int = Field(700, ge=200, le=2000, description="Width of the pictures [px]")


class EvaluateParameters(Parameters):
    """Options of `predicates evaluate`."""

    sets: tuple[str, ...] = Field(
        ("canonical", "more_objects", "novel_goals", "combined"),
        description="Sets of tasks, without the option --tasks",
    )
    each: int = Field(10, ge=1, le=200, description="Tasks of each set, or of --scene")
    states: int = Field(1000, ge=10, le=20_000, description="States that each predicate is judged on")
    robot: str = robot_option(IN_ROOMS)


def check_plan(parameters: PlanParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for a goal that is too long to read."""
    if len(parameters.goal) > 2000:
        raise UsageError("--goal: more than 2000 characters", hint="say less at a time")


def check_teach(parameters: Any, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for a robot without a room."""
    acts = inputs.get("scene") is not None
    check_robot_acts(parameters, acts=acts, without="the kitchen has no arm", hint="give the rooms: --scene FOLDER")


def check_evaluate(parameters: EvaluateParameters, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for an unknown set, and as `check_tasks` and `check_teach` do."""
    check_tasks(parameters, inputs)
    check_teach(parameters, inputs)
    check_names("--sets", parameters.sets, SET_NAMES)


def check_tasks(parameters: Any, inputs: Mapping[str, Any]) -> None:
    """Raise UsageError for a number of tasks where a folder is wanted, and for tasks and rooms together."""
    given = inputs.get("tasks")
    if given is not None and str(given).isdigit() and not Path(str(given)).exists():
        raise UsageError(f"--tasks {given}: it takes a folder of tasks", hint=f"how many of each set: --each {given}")
    if given is not None and inputs.get("scene") is not None:
        raise UsageError("--tasks are the kitchen's, --scene is of rooms", hint="leave --scene or --tasks out")


def kitchen_files(parameters: Any) -> tuple[str, ...]:
    """Return the files of `data/` that are read."""
    return (
        *(robot_files(parameters.robot) if hasattr(parameters, "robot") else ()),
        "kitchen/kitchen.toml",
        "kitchen/truth.toml",
        "kitchen/store_objects.pddl",
        "kitchen/set_table.pddl",
        "kitchen/cook_meal.pddl",
        "room/truth.toml",
        "room/room.pddl",
    )


TASKS = External("tasks of your own instead of drawn ones: JSON files of {name: {objects, goal_text, goal_lits_gt}}")
TEACH = Stage(
    name="predicates teach",
    summary="Learn predicates and operators from a simulated teacher's corrections in a planar kitchen",
    parameters=TeachParameters,
    reads={
        "learned": Optionally(LearnedDomain),
        "scene": Optionally(External("rooms to learn in instead of the kitchen: interactive scenes, `room` of truths")),
        "dialogue": Optionally(External("teacher.jsonl of an earlier --teacher terminal, replayed")),
        "transcript": Optionally(External("transcript.jsonl of an earlier --learner thesis")),
    },
    writes=LearnedDomain,
    libraries=(*LIBRARIES, "pillow"),
    module="teach_stage",
    check=check_teach,
    data_files=kitchen_files,
    example="scenewright predicates teach --domain set_table --seed 1 --out outputs/predicates/table",
)
PLAN = Stage(
    name="predicates plan",
    summary="Plan for a goal in words with what was learned, and try it in the kitchen",
    parameters=PlanParameters,
    reads={"learned": LearnedDomain, "tasks": Optionally(TASKS)},
    writes=KitchenPlan,
    libraries=(*LIBRARIES, "pillow"),
    module="plan_stage",
    check=check_plan,
    data_files=kitchen_files,
    example="scenewright predicates plan --learned outputs/predicates/table --out outputs/predicates/plan",
)
EVALUATE = Stage(
    name="predicates evaluate",
    summary="Count what is reached of sets of tasks with what was learned, beside the teacher's own operators",
    parameters=EvaluateParameters,
    reads={
        "learned": LearnedDomain,
        "scene": Optionally(External("rooms to try in what was learned in rooms")),
        "tasks": Optionally(TASKS),
    },
    writes=KitchenEvaluation,
    libraries=LIBRARIES,
    module="evaluate_stage",
    check=check_evaluate,
    data_files=kitchen_files,
    example="scenewright predicates evaluate --learned outputs/predicates/table --out outputs/predicates/evaluation",
)
STAGES = [TEACH, PLAN, EVALUATE]

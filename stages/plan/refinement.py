"""Give every symbolic action its geometry; what fails is fed back to the task search as a lesson."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scenewright.schemas.plan import Failure, TriedPlan
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.segments import Manipulation, Segment
from scenewright.stages.kit.tasks.fast_downward import plan_with_fast_downward
from scenewright.stages.kit.tasks.strips import Atom, GroundAction, Problem, apply_action, atom_text
from scenewright.stages.kit.tasks.task_planner import Heuristic, TaskPlan, plan_task
from scenewright.stages.plan.action import MotionRequest, action_named
from scenewright.stages.plan.domain import DOMAIN, START
from scenewright.stages.plan.driving import drive_way
from scenewright.stages.plan.learning import Lessons
from scenewright.stages.plan.pick_place import Budgets, GraspStyle
from scenewright.stages.plan.world_model import RobotState, WorldModel

TASK_STATES = (6000, 50_000)
"""Most states of one task search, and of one for a shortest plan: tasks of rooms take some hundreds."""
DRIVE = "drive"
LADEN_PACE = 0.25
"""Share of the full speed at which the robot drives with a laden tray."""
BASES = 3
"""Most bases from which an action is tried that the robot does not get to."""
FINAL = ("no_grasp",)
"""Failures that no other draw of the random choices can avoid."""


@dataclass(frozen=True)
class Step:
    """One action with its motion."""

    name: str
    """`drive`, or the name of an action with a motion (`actions/`)."""
    arguments: tuple[str, ...]
    segments: tuple[Segment, ...]
    manipulation: Manipulation | None
    """None for drives."""

    @property
    def text(self) -> str:
        """The action as people write it."""
        return atom_text((self.name, *self.arguments))


class RefinementFailed(Exception):
    """An action of a task plan has no motion."""

    def __init__(self, place: int, action: GroundAction, failure: Failure) -> None:
        super().__init__(failure.message)
        self.place = place
        """Index in the task plan."""
        self.action = action
        self.failure = failure


def grasp_style(model: WorldModel, item: str, following: list[tuple[str, tuple[str, ...]]]) -> GraspStyle:
    """Return how an item is to be grasped for where it is put next: `following` are (name, arguments) of actions."""
    for name, arguments in following:
        style = action_named(name).grasp_style(model, item, arguments)
        if style is not None:
            return style
    return "any"


def put_there_later(
    name: str, arguments: tuple[str, ...], following: list[tuple[str, tuple[str, ...]]]
) -> tuple[str, ...]:
    """Return what later actions, (name, arguments), put where an action puts something."""
    if action_named(name).hand != "puts":
        return ()
    return tuple(
        later[0]
        for later_name, later in following
        if action_named(later_name).hand == "puts" and later[1] == arguments[1]
    )


def refine_action(
    model: WorldModel, state: RobotState, name: str, request: MotionRequest, origin: str
) -> tuple[list[Step], RobotState]:
    """Return the drives and manipulations of one action, and the robot's state after it; the model is changed too.

    `origin` names where the drive begins. A base that the robot does not get to is left for another one, `BASES` times
    at most. Raises MotionFailed; the model is then as before.
    """
    snapshot = model.snapshot()
    for tries_left in reversed(range(BASES)):
        try:
            return _refine_from_bases(model, state, name, request, origin)
        except _NoWay as no_way:
            model.restore(snapshot)
            if not tries_left:
                raise no_way.failed from None
            request = replace(request, preferred=None)
        except MotionFailed:
            model.restore(snapshot)
            raise
    raise AssertionError("unreachable")


class _NoWay(Exception):
    """The base does not get to where a manipulation begins."""

    def __init__(self, failed: MotionFailed) -> None:
        super().__init__(str(failed))
        self.failed = failed


def _refine_from_bases(
    model: WorldModel, state: RobotState, name: str, request: MotionRequest, origin: str
) -> tuple[list[Step], RobotState]:
    """As `refine_action`, by the first bases that manipulations are found from. Raises MotionFailed and _NoWay."""
    action, arguments = action_named(name), request.arguments
    target = action.target(arguments)
    steps: list[Step] = []
    action.begin(model, arguments)
    for manipulation in action.manipulate(model, state, request):
        try:
            path = drive_way(model, state, manipulation.base, request.random, request.budgets.path_samples)
        except MotionFailed as failed:
            raise _NoWay(failed) from None
        manipulation, path = _same_turns(model, manipulation, path)
        rows = np.concatenate([path, np.tile(state.arm, (len(path), 1))], axis=1)
        pace = LADEN_PACE if state.holding is not None and model.laden(state.holding) else 1.0
        if len(path) > 1:
            # with the fingers together, though the way was checked with open ones: that much more clearance
            steps.append(Step(DRIVE, (origin, target), (Segment(rows, 0.0, pace, "", state.holding),), None))
        steps.append(Step(name, arguments, manipulation.segments, manipulation))
        state = action.effect(model, state, arguments, manipulation)
        origin = target
    return steps, state


def _same_turns(model: WorldModel, manipulation: Manipulation, path: np.ndarray) -> tuple[Manipulation, np.ndarray]:
    """Shift the yaw of the manipulation by whole turns to where the drive ends."""
    shift = path[-1] - manipulation.base
    shift[:2] = 0.0
    if abs(shift[2]) < 1e-9:
        return manipulation, path
    change = np.concatenate([shift, np.zeros(len(model.description.arm_joints))])
    segments = tuple(replace(segment, path=segment.path + change) for segment in manipulation.segments)
    return replace(manipulation, base=manipulation.base + shift, segments=segments), path


def refine_plan(
    model: WorldModel, state: RobotState, actions: list[GroundAction], budgets: Budgets, random: np.random.Generator
) -> list[Step]:
    """Return the steps of a task plan; the model is left as it was. Raises RefinementFailed.

    A symbolic `drive` has no geometry of its own: the base pose belongs to the manipulation that follows.
    """
    snapshot = model.snapshot()
    steps: list[Step] = []
    origin = START
    plain = [(action.name, action.arguments) for action in actions]
    try:
        for index, action in enumerate(actions):
            kind, arguments = action_named(action.name), action.arguments
            if not kind.has_motion:
                continue
            style = grasp_style(model, arguments[0], plain[index + 1 :]) if kind.hand == "takes" else "any"
            try:
                further = put_there_later(kind.name, arguments, plain[index + 1 :])
                request = MotionRequest(arguments, budgets, random, style=style, further=further)
                action_steps, state = refine_action(model, state, kind.name, request, origin)
            except MotionFailed as failed:
                failure = failed.failure.model_copy(update={"action": action.text})
                raise RefinementFailed(index, action, failure) from None
            steps += action_steps
            origin = kind.target(arguments)
    finally:
        model.restore(snapshot)
    return steps


@dataclass(frozen=True)
class Attempt:
    """What came of a goal: the task plan and its steps, or None, and every failure on the way."""

    actions: list[GroundAction] | None
    steps: list[Step] | None
    failures: list[Failure]
    tried: tuple[TriedPlan, ...] = ()
    learned: tuple[str, ...] = ()
    """What the failures taught the task search, in words."""


@dataclass(frozen=True)
class SearchSettings:
    """How the task search and its alternation with geometry go."""

    heuristic: Heuristic
    task_attempts: int
    refinement_attempts: int
    planner: Literal["builtin", "fast-downward"] = "builtin"


def plan_and_refine(
    model: WorldModel,
    state: RobotState,
    task: tuple[Problem, list[GroundAction]],
    budgets: Budgets,
    random: np.random.Generator,
    settings: SearchSettings,
) -> Attempt:
    """Alternate between task search and geometry. `task`: a problem without negation, and its ground actions.

    What an action's geometry fails of in all `refinement_attempts` (the earlier choices are drawn anew each time) is a
    lesson for the task search (`learning`), at most `task_attempts` times.
    """
    problem, actions = task
    failures: list[Failure] = []
    lessons = Lessons(held=next((atom[1] for atom in problem.initial if atom[0] == "holding"), None))
    tried: list[TriedPlan] = []
    heuristic = settings.heuristic
    for _ in range(settings.task_attempts):
        allowed = lessons.apply(actions)
        if settings.planner == "builtin":
            plan = plan_task(problem, allowed, heuristic=heuristic, limit=TASK_STATES[heuristic == "max"])
        else:
            plan = plan_with_fast_downward(DOMAIN, problem, allowed)
        if plan.actions is None:
            failures.append(_no_task_plan(problem, plan, lessons))
            return Attempt(None, None, failures, tuple(tried), tuple(lessons.words))
        texts = tuple(action.text for action in plan.actions)
        worst: RefinementFailed | None = None
        for _ in range(settings.refinement_attempts):
            try:
                steps = refine_plan(model, state, plan.actions, budgets, random)
                tried.append(TriedPlan(actions=texts))
                return Attempt(plan.actions, steps, failures, tuple(tried), tuple(lessons.words))
            except RefinementFailed as failed:
                failures.append(failed.failure)
                tried.append(TriedPlan(actions=texts, failed_action=failed.place, failure=failed.failure))
                worst = failed
                if failed.failure.kind in FINAL:
                    break
        assert worst is not None
        before = problem.initial
        for action in plan.actions[: worst.place]:
            before = apply_action(before, action)
        lessons.learn(worst.action, worst.failure, actions, before)
    return Attempt(None, None, failures, tuple(tried), tuple(lessons.words))


def _no_task_plan(problem: Problem, plan: TaskPlan, lessons: Lessons) -> Failure:
    without = f" ({'; '.join(lessons.words)})" if lessons.words else ""
    if plan.unreachable:
        names = ", ".join(atom_text(atom) for atom in plan.unreachable)
        message = f"no sequence of actions makes {names} true{without}{_lacking_affordances(problem, plan.unreachable)}"
    elif plan.exhausted:
        names = ", ".join(sorted(atom_text(atom) for atom in problem.goal))
        message = f"each of {names} can be reached, but not all together{without}"
    else:
        message = f"no task plan within {plan.expanded} expanded states{without}"
    objects = sorted({name for atom in plan.unreachable or problem.goal for name in atom[1:]})
    return Failure(
        kind="goal_unsatisfiable" if plan.exhausted else "search_limit",
        message=message,
        objects=tuple(objects),
        numbers={"expanded": float(plan.expanded), "lessons": float(len(lessons.words))},
    )


def _lacking_affordances(problem: Problem, unreachable: tuple[Atom, ...]) -> str:
    """Return the affordances that goals lack, in words: why they cannot be reached, as far as single things say it."""
    words = []
    for predicate, *names in unreachable:
        item, target = names[0], names[-1]
        if predicate in ("open", "closed"):
            affordances: tuple[Atom, ...] = (("reachable", item),)
        else:
            affordances = (("graspable", item), ("reachable", item))
        words += [f"{atom[1]} is not {atom[0]}" for atom in affordances if atom not in problem.initial]
        doors = [atom[1] for atom in problem.initial if atom[0] == "entrance" and atom[2] == target]
        places = {"on": [target], "in": doors}.get(predicate, [])
        if places and not any(("fits", item, target_name) in problem.initial for target_name in places):
            words.append(f"{target} has no room for {item}")
    return f": {', '.join(dict.fromkeys(words))}" if words else ""

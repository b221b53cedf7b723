"""Give every symbolic action its geometry; what fails is fed back to the task search as a lesson."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from schemas.plan import Failure, TriedPlan
from stages.kit.motion.base_placement import plan_drive
from stages.kit.motion.failures import MotionFailed
from stages.kit.tasks.fast_downward import plan_with_fast_downward
from stages.kit.tasks.strips import Atom, Domain, GroundAction, Problem, apply_action, atom_text, ground
from stages.kit.tasks.task_planner import Heuristic, TaskPlan, plan_task
from stages.plan.domain import PLAIN_NAMES, START
from stages.plan.door_motion import plan_close, plan_open
from stages.plan.learning import Lessons
from stages.plan.motions import Manipulation, Segment
from stages.plan.pick_place import Budgets, GraspStyle, plan_pick, plan_place
from stages.plan.placements import placement_style
from stages.plan.world_model import RobotState, WorldModel

TASK_STATES = (6000, 50_000)
"""Most states of one task search, and of one for a shortest plan: tasks of rooms take some hundreds."""
LADEN_PACE = 0.25
"""Share of the full speed at which the robot drives with a laden tray."""
FINAL = ("no_grasp",)
"""Failures that no other draw of the random choices can avoid."""


@dataclass(frozen=True)
class Step:
    """One action with its motion."""

    name: str
    """`drive`, `pick`, `place`, `open`, `close`."""
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


def manipulate(
    model: WorldModel,
    state: RobotState,
    name: str,
    arguments: tuple[str, ...],
    budgets: Budgets,
    random: np.random.Generator,
    preferred: tuple[np.ndarray, np.ndarray] | None = None,
    style: GraspStyle = "any",
) -> tuple[Manipulation, ...]:
    """Return the manipulations of `pick`, `place`, `open` or `close` (plain names). Raises MotionFailed.

    Arguments: pick(item, from, ...), place(item, target[, door]), open(joint), close(joint).
    """
    if name == "pick":
        return (plan_pick(model, state, arguments[0], arguments[1], budgets, random, preferred, style),)
    if name == "place":
        door = arguments[2] if len(arguments) > 2 else None
        return (plan_place(model, state, arguments[0], arguments[1], door, budgets, random, preferred),)
    plan = plan_open if name == "open" else plan_close
    return plan(model, state, model.owner(arguments[0]), arguments[0], budgets, random)


def grasp_style(model: WorldModel, item: str, following: list[tuple[str, tuple[str, ...]]]) -> GraspStyle:
    """Return how an item is to be grasped for where it is put next: `following` are (plain name, arguments)."""
    for name, arguments in following:
        if name == "place" and arguments[0] == item:
            return placement_style(model, item, arguments[1], arguments[2] if len(arguments) > 2 else None)
    return "any"


def refine_action(
    model: WorldModel,
    state: RobotState,
    name: str,
    arguments: tuple[str, ...],
    origin: str,
    budgets: Budgets,
    random: np.random.Generator,
    preferred: tuple[np.ndarray, np.ndarray] | None = None,
    style: GraspStyle = "any",
) -> tuple[list[Step], RobotState]:
    """Return the drives and manipulations of one action, and the robot's state after it; the model is changed too.

    `origin` names where the drive begins. Raises MotionFailed; the model is then as before.
    """
    snapshot = model.snapshot()
    steps: list[Step] = []
    try:
        if name == "pick":
            model.take_aboard(arguments[0])
        for manipulation in manipulate(model, state, name, arguments, budgets, random, preferred, style):
            target = arguments[1] if name == "place" else arguments[0]
            hold_for_checks(model, state)
            path = plan_drive(
                state.base,
                manipulation.base,
                state.arm,
                model.checker,
                model.room,
                random,
                samples=budgets.path_samples,
            )
            manipulation, path = _same_turns(manipulation, path)
            rows = np.concatenate([path, np.tile(state.arm, (len(path), 1))], axis=1)
            pace = LADEN_PACE if state.holding is not None and model.laden(state.holding) else 1.0
            if len(path) > 1:
                # with the fingers together, though the way was checked with open ones: that much more clearance
                steps.append(Step("drive", (origin, target), (Segment(rows, 0.0, pace, "", state.holding),), None))
            steps.append(Step(name, arguments, manipulation.segments, manipulation))
            state = apply_effect(model, state, name, arguments, manipulation)
            origin = target
    except MotionFailed:
        model.restore(snapshot)
        raise
    return steps, state


def hold_for_checks(model: WorldModel, state: RobotState) -> None:
    """Make the checker carry what the robot holds (or nothing)."""
    model.checker.allow(touch=model.links(state.holding) if state.holding else ())
    if state.holding is not None and state.tool_from_item is not None:
        model.checker.carry(state.holding, state.tool_from_item)
    else:
        model.checker.put_down()


def _same_turns(manipulation: Manipulation, path: np.ndarray) -> tuple[Manipulation, np.ndarray]:
    """Shift the yaw of the manipulation by whole turns to where the drive ends."""
    shift = path[-1] - manipulation.base
    shift[:2] = 0.0
    if abs(shift[2]) < 1e-9:
        return manipulation, path
    change = np.concatenate([shift, np.zeros(7)])
    segments = tuple(replace(segment, path=segment.path + change) for segment in manipulation.segments)
    return replace(manipulation, base=manipulation.base + shift, segments=segments), path


def apply_effect(
    model: WorldModel, state: RobotState, name: str, arguments: tuple[str, ...], manipulation: Manipulation
) -> RobotState:
    """Bring the model to what it is after a manipulation, and return the robot's state."""
    arm = manipulation.segments[-1].path[-1, 3:]
    if name == "pick":
        state = RobotState(
            manipulation.base, arm, arguments[0], manipulation.tool_from_item, manipulation.body_from_tool
        )
        hold_for_checks(model, state)
        return state
    state = RobotState(manipulation.base, arm)
    hold_for_checks(model, state)
    if name == "place" and manipulation.item_pose is not None:
        model.world.set_pose(arguments[0], manipulation.item_pose)
        model.set_down()
        model.put_on(arguments[0], arguments[1])
    for joint, value in manipulation.joint_values.items():
        model.move_joint(joint, value)
    return state


def refine_plan(
    model: WorldModel, state: RobotState, actions: list[GroundAction], budgets: Budgets, random: np.random.Generator
) -> list[Step]:
    """Return the steps of a task plan; the model is left as it was. Raises RefinementFailed.

    A symbolic `drive` has no geometry of its own: the base pose belongs to the manipulation that follows.
    """
    snapshot = model.snapshot()
    steps: list[Step] = []
    origin = START
    plain = [(PLAIN_NAMES.get(action.name, action.name), action.arguments) for action in actions]
    try:
        for place, (action, (name, arguments)) in enumerate(zip(actions, plain, strict=True)):
            if name == "drive":
                continue
            style = grasp_style(model, arguments[0], plain[place + 1 :]) if name == "pick" else "any"
            try:
                found, state = refine_action(
                    model, state, name, arguments, origin, budgets, random, style=style
                )  # fmt: skip
            except MotionFailed as failed:
                failure = failed.failure.model_copy(update={"action": action.text})
                raise RefinementFailed(place, action, failure) from None
            steps += found
            origin = arguments[1] if name == "place" else arguments[0]
    finally:
        model.restore(snapshot)
        hold_for_checks(model, RobotState(state.base, state.arm))
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


def plan_and_refine(
    model: WorldModel,
    state: RobotState,
    domain: Domain,
    problem: Problem,
    budgets: Budgets,
    random: np.random.Generator,
    *,
    heuristic: Heuristic,
    task_attempts: int,
    refinement_attempts: int,
    planner: Literal["builtin", "fast-downward"] = "builtin",
) -> Attempt:
    """Alternate between task search and geometry.

    What an action's geometry fails of in all `refinement_attempts` (the earlier choices are drawn anew each time) is a
    lesson for the task search (`learning`), at most `task_attempts` times.
    """
    actions = ground(domain, problem)
    failures: list[Failure] = []
    lessons = Lessons(held=next((atom[1] for atom in problem.initial if atom[0] == "holding"), None))
    tried: list[TriedPlan] = []
    for _ in range(task_attempts):
        allowed = lessons.apply(actions)
        if planner == "builtin":
            found = plan_task(problem, allowed, heuristic=heuristic, limit=TASK_STATES[heuristic == "max"])
        else:
            found = plan_with_fast_downward(domain, problem, allowed)
        if found.actions is None:
            failures.append(_no_task_plan(problem, found, lessons))
            return Attempt(None, None, failures, tuple(tried), tuple(lessons.words))
        texts = tuple(action.text for action in found.actions)
        worst: RefinementFailed | None = None
        for _ in range(refinement_attempts):
            try:
                steps = refine_plan(model, state, found.actions, budgets, random)
                tried.append(TriedPlan(actions=texts))
                return Attempt(found.actions, steps, failures, tuple(tried), tuple(lessons.words))
            except RefinementFailed as failed:
                failures.append(failed.failure)
                tried.append(TriedPlan(actions=texts, failed_action=failed.place, failure=failed.failure))
                worst = failed
                if failed.failure.kind in FINAL:
                    break
        assert worst is not None
        before = problem.initial
        for action in found.actions[: worst.place]:
            before = apply_action(before, action)
        lessons.learn(worst.action, worst.failure, actions, before)
    return Attempt(None, None, failures, tuple(tried), tuple(lessons.words))


def _no_task_plan(problem: Problem, found: TaskPlan, lessons: Lessons) -> Failure:
    without = f" ({'; '.join(lessons.words)})" if lessons.words else ""
    if found.unreachable:
        names = ", ".join(atom_text(atom) for atom in found.unreachable)
        message = f"no sequence of actions makes {names} true{without}{_lacking(problem, found.unreachable)}"
    elif found.exhausted:
        names = ", ".join(sorted(atom_text(atom) for atom in problem.goal))
        message = f"each of {names} can be reached, but not all together{without}"
    else:
        message = f"no task plan within {found.expanded} expanded states{without}"
    objects = sorted({name for atom in found.unreachable or problem.goal for name in atom[1:]})
    return Failure(
        kind="goal_unsatisfiable" if found.exhausted else "search_limit",
        message=message,
        objects=tuple(objects),
        numbers={"expanded": float(found.expanded), "lessons": float(len(lessons.words))},
    )


def _lacking(problem: Problem, unreachable: tuple[Atom, ...]) -> str:
    """Return the affordances that goals lack, in words: why they cannot be reached, as far as single things say it."""
    words = []
    for predicate, *names in unreachable:
        item, target = names[0], names[-1]
        if predicate in ("open", "closed"):
            wanted: tuple[Atom, ...] = (("reachable", item),)
        else:
            wanted = (("graspable", item), ("reachable", item))
        words += [f"{atom[1]} is not {atom[0]}" for atom in wanted if atom not in problem.initial]
        doors = [atom[1] for atom in problem.initial if atom[0] == "entrance" and atom[2] == target]
        places = {"on": [target], "in": doors}.get(predicate, [])
        if places and not any(("fits", item, place) in problem.initial for place in places):
            words.append(f"{target} has no room for {item}")
    return f": {', '.join(dict.fromkeys(words))}" if words else ""

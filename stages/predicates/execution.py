"""Carrying out plans in the kitchen: step by step, planning anew when an action failed or came out otherwise."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.fast_downward import plan_with_fast_downward
from scenewright.stages.kit.tasks.strips import Atom, Domain, GroundAction, Problem, apply_action, ground
from scenewright.stages.kit.tasks.task_planner import TaskPlan, plan_task
from scenewright.stages.predicates.learning.setting import SETTINGS
from scenewright.stages.predicates.state import State
from scenewright.stages.predicates.tasks import Task, open_kitchen, true_atoms
from scenewright.stages.predicates.truth import action_of, true_domain
from scenewright.stages.predicates.world.actions import act
from scenewright.stages.predicates.world.kitchen import Kitchen

MOST_STEPS, MOST_FAILURES = 20, 5
"""Most actions of a task, and most failures; by eye."""
ARITY = {name: count for setting in SETTINGS.values() for name, count in setting.arity.items()}
PLANNING_LIMIT, SHORTENING = 5_000, 300
"""Expanded states of one search, and of each that looks for a shorter plan: plans are wanted within moments. While a
plan has more actions than the task allows, as many states as a search may take go into shorter ones."""


def action_atom(action: GroundAction) -> Atom:
    """Return the action of the kitchen that a ground operator does: its name, and the objects that the action takes."""
    name = action_of(action.name)
    return (name, *action.arguments[: ARITY[name]])


@dataclass
class Attempt:
    """One task, tried."""

    success: bool = False
    steps: list[tuple[Atom, str]] = field(default_factory=list)
    """Actions done, and why each failed, if it did."""
    planning: list[float] = field(default_factory=list)
    """Processor seconds of each search."""
    unplanned: str = ""
    """Why there was no plan."""
    unreachable: tuple[Atom, ...] = ()
    """Wanted atoms that no actions can make true."""


Abstraction = Callable[[Perceived], frozenset[Atom]]
Planner = Callable[[Domain, list[str], frozenset[Atom], frozenset[Atom], frozenset[Atom], int], tuple[TaskPlan, float]]
"""Domain, objects, what holds, what is wanted, actions to avoid, actions that may still be done -> plan and the seconds
that it took."""


class World(Protocol):
    """Where actions are done."""

    def state(self) -> Perceived:
        """What is perceived now."""
        ...

    def do(self, action: Atom) -> str:
        """Do an action; returns why it failed, or nothing."""
        ...


class Live:
    """A kitchen that is there."""

    def __init__(self, kitchen: Kitchen) -> None:
        self.kitchen = kitchen

    def state(self) -> State:
        """What is perceived now."""
        return self.kitchen.state()

    def do(self, action: Atom) -> str:
        """Do an action."""
        return act(self.kitchen, action)


Replays = dict[tuple[str, int, tuple[Atom, ...]], tuple[str, State]]


class Replayed:
    """A task's kitchen that remembers, in `known`, what came of actions: what was done before is not simulated again,
    since the same actions have the same ends."""

    def __init__(self, task: Task, known: Replays) -> None:
        self.task, self.known = task, known
        self._done: tuple[Atom, ...] = ()
        self._kitchen: Kitchen | None = None
        self._at: tuple[Atom, ...] = ()

    def state(self) -> State:
        """What is perceived now."""
        return self._after(self._done)[1]

    def do(self, action: Atom) -> str:
        """Do an action."""
        self._done = (*self._done, action)
        return self._after(self._done)[0]

    def _after(self, actions: tuple[Atom, ...]) -> tuple[str, State]:
        key = (self.task.name, self.task.seed, actions)
        if key not in self.known:
            if self._kitchen is None or self._at != actions[: len(self._at)]:
                self._kitchen, self._at = open_kitchen(self.task), ()
            reason = ""
            for action in actions[len(self._at) :]:
                reason = act(self._kitchen, action)
            self._at = actions
            self.known[key] = (reason, self._kitchen.state())
        return self.known[key]


def attempt(
    task: Task,
    name: str,
    domain: Domain,
    see: Abstraction,
    goal: frozenset[Atom],
    *,
    replan: bool,
    world: World | None = None,
    planner: Planner | None = None,
) -> Attempt:
    """Try a task of the kitchen's domain `name` with operators `domain`; `see` says which of its atoms hold.

    With `replan` a new plan is made when an action fails or when what holds then is not what was expected of it, within
    the caps of the protocol (20 steps, 5 failures in a row); else the first plan is followed to its end or its first
    failure. Success is what the teacher says at the end.
    """
    kitchen = world or Live(open_kitchen(task))
    planner = planner or timed_plan
    result = Attempt()
    failures = 0
    plan: list[GroundAction] = []
    expected: frozenset[Atom] = frozenset()
    avoided: set[Atom] = set()
    """What failed since something last changed, and what was done and changed nothing."""
    useless: set[Atom] = set()
    while len(result.steps) < MOST_STEPS and failures < MOST_FAILURES:
        if not plan or (replan and expected != see(kitchen.state())):
            atoms = see(kitchen.state())
            if goal <= atoms and (replan or not result.steps):
                break
            if result.steps and not replan:
                break
            left = MOST_STEPS - len(result.steps)
            outcome, seconds = planner(domain, list(task.objects), atoms, goal, frozenset(avoided), left)
            result.planning.append(seconds)
            if not outcome.actions:
                result.unreachable = outcome.unreachable
                lost = ", ".join(" ".join(atom) for atom in outcome.unreachable)
                result.unplanned = f"out of reach: {lost}" if lost else "no plan"
                break
            plan, expected = outcome.actions, atoms
        operator = plan[0]
        reason = kitchen.do(action_atom(operator))
        result.steps.append((action_atom(operator), reason))
        if reason:
            failures += 1
            avoided.add(action_atom(operator))
            plan = []
            if not replan:
                break
        else:
            failures, plan = 0, plan[1:]
            avoided = set(useless)
            before, expected = expected, apply_action(expected, operator)
            if replan and see(kitchen.state()) == before != expected:
                useless.add(action_atom(operator))
                avoided.add(action_atom(operator))
                plan = []
    result.success = set(task.goal) <= true_atoms(kitchen.state(), name)
    return result


def why_not(result: Attempt) -> str:
    """Return in words why a goal was not reached."""
    failed = [f"{' '.join(action)}: {reason}" for action, reason in result.steps if reason]
    return result.unplanned or (failed[-1] if failed else f"not there after {len(result.steps)} actions")


def timed_plan(
    domain: Domain,
    objects: list[str],
    atoms: frozenset[Atom],
    goal: frozenset[Atom],
    avoided: frozenset[Atom],
    longest: int,
) -> tuple[TaskPlan, float]:
    """Return `plan_without`, and the processor's seconds that it took (a loaded machine makes no difference)."""
    start = time.thread_time()
    outcome = plan_without(domain, objects, atoms, goal, avoided, longest)
    return outcome, time.thread_time() - start


def plan_without(
    domain: Domain,
    objects: list[str],
    atoms: frozenset[Atom],
    goal: frozenset[Atom],
    avoided: frozenset[Atom],
    longest: int,
) -> TaskPlan:
    """Return a plan without actions that have just failed, where there is one; else any plan. One of at most `longest`
    actions is looked for."""
    problem = Problem("task", dict.fromkeys(objects, ""), atoms, goal)
    actions = ground(domain, problem)
    allowed_actions = [action for action in actions if action_atom(action) not in avoided]
    outcome = plan_task(problem, allowed_actions, limit=PLANNING_LIMIT, improvement=SHORTENING, longest=longest)
    if not outcome.actions and avoided:
        outcome = plan_task(problem, actions, limit=PLANNING_LIMIT, improvement=SHORTENING, longest=longest)
    return outcome


def fast_downward_plan(
    domain: Domain,
    objects: list[str],
    atoms: frozenset[Atom],
    goal: frozenset[Atom],
    avoided: frozenset[Atom],
    longest: int,
) -> tuple[TaskPlan, float]:
    """Return a plan by Fast Downward as `timed_plan` does, of whatever length; what can't be reached is found by our
    own heuristic. Raises as `plan_with_fast_downward` does."""
    start = time.thread_time()
    problem = Problem("task", dict.fromkeys(objects, ""), atoms, goal)
    actions = ground(domain, problem)
    allowed_actions = [action for action in actions if action_atom(action) not in avoided]
    outcome = plan_with_fast_downward(domain, problem, allowed_actions)
    if not outcome.actions and avoided:
        outcome = plan_with_fast_downward(domain, problem, actions)
    if not outcome.actions:
        outcome = plan_task(problem, actions, limit=0)
    return outcome, time.thread_time() - start


PLANNERS: dict[str, Planner] = {"builtin": timed_plan, "fast-downward": fast_downward_plan}


def oracle(task: Task, name: str, world: World | None = None, planner: Planner | None = None) -> Attempt:
    """Try a task with the teacher's own operators and predicates: the ceiling of physics."""

    def see(state: Perceived) -> frozenset[Atom]:
        return true_atoms(state, name)

    return attempt(task, name, true_domain(name), see, frozenset(task.goal), replan=True, world=world, planner=planner)

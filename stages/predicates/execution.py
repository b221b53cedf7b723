"""Carrying out plans in the kitchen: step by step, planning anew when an action failed or came out otherwise."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from stages.kit.tasks.strips import Atom, Domain, GroundAction, Problem, apply_action, ground
from stages.kit.tasks.task_planner import TaskPlan, plan_task
from stages.predicates.state import State
from stages.predicates.tasks import Task, open_kitchen, true_atoms
from stages.predicates.truth import action_of, true_domain
from stages.predicates.world.actions import ARITY, act

MOST_STEPS, MOST_FAILURES = 20, 5
PLANNING_LIMIT = 5_000
"""Expanded states of one search."""


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
    """Seconds of each search."""
    unplanned: str = ""
    """Why there was no plan."""


Abstraction = Callable[[State], frozenset[Atom]]


def attempt(task: Task, name: str, domain: Domain, see: Abstraction, goal: frozenset[Atom], *, replan: bool) -> Attempt:
    """Try a task of the kitchen's domain `name` with operators `domain`; `see` says which of its atoms hold.

    With `replan` a new plan is made when an action fails or when what holds then is not what was expected of it, within
    the caps of the protocol (20 steps, 5 failures in a row); else the first plan is followed to its end or its first
    failure. Success is what the teacher says at the end.
    """
    kitchen = open_kitchen(task)
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
            start = time.perf_counter()
            found = _plan_without(domain, list(task.objects), atoms, goal, avoided)
            result.planning.append(time.perf_counter() - start)
            if not found.actions:
                lost = ", ".join(" ".join(atom) for atom in found.unreachable)
                result.unplanned = f"out of reach: {lost}" if lost else "no plan"
                break
            plan, expected = found.actions, atoms
        operator = plan[0]
        reason = act(kitchen, action_atom(operator))
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


def _plan_without(
    domain: Domain, objects: list[str], atoms: frozenset[Atom], goal: frozenset[Atom], avoided: set[Atom]
) -> TaskPlan:
    """Return a plan that begins with no action that has just failed, where there is one; else any plan."""
    problem = Problem("task", dict.fromkeys(objects, ""), atoms, goal)
    actions = ground(domain, problem)
    if avoided:
        other = plan_task(problem, [a for a in actions if action_atom(a) not in avoided], limit=PLANNING_LIMIT)
        if other.actions:
            return other
    return plan_task(problem, actions, limit=PLANNING_LIMIT)


def oracle(task: Task, name: str) -> Attempt:
    """Try a task with the teacher's own operators and predicates: the ceiling of physics."""
    return attempt(
        task, name, true_domain(name), lambda state: true_atoms(state, name), frozenset(task.goal), replan=True
    )

"""Search for task plans: greedy with two heuristics (default), or A* with the maximum heuristic (shortest plans).

The default is after LAMA (Richter & Westphal 2010): greedy best-first search that takes turns between h_FF and the
count of landmarks left, with queues of their own for preferred actions, evaluation deferred until a state is expanded;
then weighted A* with falling weights looks for shorter plans, within a few hundred states each, and goes on while a
plan is longer than may be done. h_add, h_max: Bonet &
Geffner 2001. Everything is counted in expanded states, so that the same task gives the same plan.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.stages.kit.tasks.estimator import Estimator
from scenewright.stages.kit.tasks.landmarks import find_landmarks
from scenewright.stages.kit.tasks.lazy_search import LazySearch
from scenewright.stages.kit.tasks.relaxed import FAR, Relaxed, applicable, relax, successor
from scenewright.stages.kit.tasks.strips import Atom, GroundAction, Problem

Heuristic = Literal["landmarks", "add", "max", "ff"]
WEIGHTS = (5, 2, 1)
"""Weights of the heuristic in the searches that shorten the first plan."""
IMPROVEMENT = 600
"""Most states that are expanded in each search that shortens the first plan."""


@dataclass(frozen=True)
class TaskPlan:
    """What the search found."""

    actions: list[GroundAction] | None
    """None: no plan within the limit, or none at all (`exhausted`)."""
    expanded: int
    exhausted: bool
    """The whole reachable space was searched: there is no plan."""
    unreachable: tuple[Atom, ...] = ()
    """Goal atoms that no sequence of actions can make true, even when nothing is ever deleted."""


def plan_task(
    problem: Problem,
    actions: list[GroundAction],
    *,
    heuristic: Heuristic = "landmarks",
    limit: int = 50_000,
    improvement: int = IMPROVEMENT,
    longest: int | None = None,
) -> TaskPlan:
    """Search for a plan; every action costs 1. `limit` bounds the expanded states; ties fall to the older state.

    `max` gives a shortest plan; `landmarks` a good one fast, for which `improvement` bounds the states that each search
    for a shorter one expands. While a plan has more than `longest` actions, further rounds look for shorter ones, each
    with twice the states of the one before, until they have expanded `limit` states again.
    """
    task = relax(problem, actions)
    estimate = Estimator(task, "max")
    estimate(task.initial)
    lost = tuple(task.atoms[atom] for atom in task.goal if estimate.cost[atom] >= FAR)
    if lost:
        return TaskPlan(None, 0, True, lost)
    if heuristic == "landmarks":
        return _landmark_plan(task, limit, min(improvement, limit), longest)
    return _a_star(task, Estimator(task, heuristic), limit)


def _landmark_plan(task: Relaxed, limit: int, improvement: int, longest: int | None) -> TaskPlan:
    search = LazySearch(task, find_landmarks(task))
    first = search.run(None, limit, None)
    if first.plan is None:
        return TaskPlan(None, first.expanded, first.exhausted)
    plan, expanded = first.plan, first.expanded
    in_all = 0 if longest is None else expanded + limit
    while True:
        for weight in WEIGHTS:
            better = search.run(weight, improvement, len(plan))
            expanded += better.expanded
            plan = plan if better.plan is None else better.plan
        done = longest is None or len(plan) <= longest or better.exhausted or expanded >= in_all
        if done:
            return TaskPlan([task.actions[action] for action in plan], expanded, False)
        improvement = min(2 * improvement, in_all - expanded)


def _a_star(task: Relaxed, estimate: Estimator, limit: int) -> TaskPlan:
    start = task.initial
    key = start.tobytes()
    best_cost = {key: 0}
    parent: dict[bytes, tuple[bytes, int]] = {}
    queue = [(estimate(start), 0, 0, key)]
    counter = expanded = 0
    while queue:
        _, _, cost, key = heapq.heappop(queue)
        cost = -cost
        if cost > best_cost[key]:
            continue
        state = np.frombuffer(key, dtype=np.uint8).copy()
        if state[task.goal].all():
            return TaskPlan(_trace(task, parent, key), expanded, False)
        if expanded >= limit:
            return TaskPlan(None, expanded, False)
        expanded += 1
        for action in applicable(state, task.pre, task.pre_at).tolist():
            after = successor(task, state, action)
            after_key = after.tobytes()
            if cost + 1 < best_cost.get(after_key, FAR):
                value = estimate(after)
                if value >= FAR:
                    continue
                best_cost[after_key] = cost + 1
                parent[after_key] = (key, action)
                counter += 1
                heapq.heappush(queue, (cost + 1 + value, counter, -(cost + 1), after_key))
    return TaskPlan(None, expanded, True)


def _trace(task: Relaxed, parent: dict[bytes, tuple[bytes, int]], key: bytes) -> list[GroundAction]:
    plan = []
    while key in parent:
        key, action = parent[key]
        plan.append(task.actions[action])
    return plan[::-1]

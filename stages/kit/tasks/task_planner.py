"""Forward search over grounded STRIPS actions: A* with the additive, FF or maximum heuristic of the relaxed problem.

Bonet & Geffner 2001 (h_add, h_max), Hoffmann & Nebel 2001 (h_FF). h_max never overestimates, so that its plans are
shortest; the other two find plans with fewer expansions.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Literal

from stages.kit.tasks.strips import Atom, GroundAction, Problem

Heuristic = Literal["add", "max", "ff"]


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


class _Task:
    """The problem as bit masks, with the relaxed exploration."""

    def __init__(self, problem: Problem, actions: list[GroundAction]) -> None:
        atoms = set(problem.initial | problem.goal)
        for action in actions:
            atoms |= action.preconditions | action.add | action.delete
        self.number = {atom: place for place, atom in enumerate(sorted(atoms))}
        self.actions = actions
        self.preconditions = [[self.number[a] for a in sorted(action.preconditions)] for action in actions]
        self.adds = [[self.number[a] for a in sorted(action.add)] for action in actions]
        self.pre_masks = [self.mask(action.preconditions) for action in actions]
        self.add_masks = [self.mask(action.add) for action in actions]
        self.keep_masks = [~self.mask(action.delete) for action in actions]
        self.needed_by: list[list[int]] = [[] for _ in atoms]
        for place, needs in enumerate(self.preconditions):
            for atom in needs:
                self.needed_by[atom].append(place)
        self.goal = [self.number[atom] for atom in sorted(problem.goal)]
        self.goal_mask = self.mask(problem.goal)

    def mask(self, atoms: frozenset[Atom]) -> int:
        total = 0
        for atom in atoms:
            total |= 1 << self.number[atom]
        return total

    def relaxed_costs(self, state: int, use_max: bool) -> tuple[list[float], list[int]]:
        """Return the cost of each atom when nothing is deleted, and its cheapest action (-1: none needed)."""
        infinity = float("inf")
        costs = [infinity] * len(self.number)
        best = [-1] * len(self.number)
        waiting = [len(needs) for needs in self.preconditions]
        sums = [0.0] * len(self.actions)
        queue: list[tuple[float, int]] = []

        def offer(atom: int, cost: float, action: int) -> None:
            if cost < costs[atom]:
                costs[atom], best[atom] = cost, action
                heapq.heappush(queue, (cost, atom))

        for atom in range(len(self.number)):
            if state >> atom & 1:
                offer(atom, 0.0, -1)
        for place, needs in enumerate(self.preconditions):
            if not needs:
                for atom in self.adds[place]:
                    offer(atom, 1.0, place)
        done = [False] * len(self.number)
        while queue:
            cost, atom = heapq.heappop(queue)
            if done[atom]:
                continue
            done[atom] = True
            for place in self.needed_by[atom]:
                sums[place] = max(sums[place], cost) if use_max else sums[place] + cost
                waiting[place] -= 1
                if waiting[place] == 0:
                    for added in self.adds[place]:
                        offer(added, sums[place] + 1.0, place)
        return costs, best

    def estimate(self, state: int, heuristic: Heuristic) -> float:
        costs, best = self.relaxed_costs(state, heuristic == "max")
        values = [costs[atom] for atom in self.goal]
        if heuristic == "max":
            return max(values, default=0.0)
        if heuristic == "add" or float("inf") in values:
            return sum(values)
        chosen: set[int] = set()
        open_atoms = list(self.goal)
        while open_atoms:
            action = best[open_atoms.pop()]
            if action >= 0 and action not in chosen:
                chosen.add(action)
                open_atoms.extend(self.preconditions[action])
        return float(len(chosen))


def plan_task(
    problem: Problem, actions: list[GroundAction], *, heuristic: Heuristic = "add", limit: int = 50_000
) -> TaskPlan:
    """Search for a plan; every action costs 1. `limit` bounds the expanded states; ties fall to the older state."""
    task = _Task(problem, actions)
    start = task.mask(problem.initial)
    costs, _ = task.relaxed_costs(start, True)
    lost = tuple(sorted(atom for atom in problem.goal if costs[task.number[atom]] == float("inf")))
    if lost:
        return TaskPlan(None, 0, True, lost)
    best_cost = {start: 0}
    parent: dict[int, tuple[int, int]] = {}
    queue = [(task.estimate(start, heuristic), 0, 0, start)]
    counter = expanded = 0
    while queue:
        _, _, cost, state = heapq.heappop(queue)
        cost = -cost
        if cost > best_cost[state]:
            continue
        if state & task.goal_mask == task.goal_mask:
            return TaskPlan(_trace(task, parent, state, start), expanded, False)
        if expanded >= limit:
            return TaskPlan(None, expanded, False)
        expanded += 1
        for place, needs in enumerate(task.pre_masks):
            if state & needs != needs:
                continue
            after = (state & task.keep_masks[place]) | task.add_masks[place]
            if cost + 1 < best_cost.get(after, 1 << 60):
                estimate = task.estimate(after, heuristic)
                if estimate == float("inf"):
                    continue
                best_cost[after] = cost + 1
                parent[after] = (state, place)
                counter += 1
                heapq.heappush(queue, (cost + 1 + estimate, counter, -(cost + 1), after))
    return TaskPlan(None, expanded, True)


def _trace(task: _Task, parent: dict[int, tuple[int, int]], state: int, start: int) -> list[GroundAction]:
    plan = []
    while state != start:
        state, place = parent[state]
        plan.append(task.actions[place])
    return plan[::-1]

"""Best-first search with deferred evaluation that takes turns between queues: two heuristics, with preferred actions.

Richter & Westphal 2010, section 3: a state is evaluated when it is taken from a queue; its successors wait under its
values. Queues of preferred actions get 1000 turns more whenever a heuristic falls to a new low.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.kit.tasks.estimator import Estimator
from scenewright.stages.kit.tasks.landmarks import Landmarks
from scenewright.stages.kit.tasks.relaxed import FAR, Relaxed, applicable, successor

BOOST = 1000
"""Turns that the queues of preferred actions get whenever a heuristic falls to a new low (Richter & Westphal 2010)."""


@dataclass(frozen=True)
class Found:
    """What one search found."""

    plan: list[int] | None
    """Indices of actions."""
    expanded: int
    exhausted: bool
    """Nothing is left to look at (with a bound: nothing shorter either)."""


@dataclass
class _Queues:
    """Four heaps: by h_FF and by landmarks, each of all and of preferred actions."""

    heaps: list[list[tuple[int, int, int, int]]] = field(default_factory=lambda: [[], [], [], []])
    turns: list[int] = field(default_factory=lambda: [0, 0, 0, 0])
    counter: int = 0

    def push(self, values: tuple[int, int], node: int, action: int, preferred: bool) -> None:
        self.counter += 1
        for which, value in enumerate(values):
            heapq.heappush(self.heaps[2 * which], (value, self.counter, node, action))
            if preferred:
                heapq.heappush(self.heaps[2 * which + 1], (value, self.counter, node, action))

    def pop(self) -> tuple[int, int] | None:
        filled = [which for which in range(4) if self.heaps[which]]
        if not filled:
            return None
        which = min(filled, key=lambda queue: self.turns[queue])
        self.turns[which] += 1
        _, _, node, action = heapq.heappop(self.heaps[which])
        return node, action

    def boost(self) -> None:
        for which in (1, 3):
            self.turns[which] -= BOOST


@dataclass
class _Node:
    state: np.ndarray
    accepted: np.ndarray
    parent: int
    action: int
    cost: int


class LazySearch:
    """Searches over one task."""

    def __init__(self, task: Relaxed, landmarks: Landmarks) -> None:
        self.task, self.landmarks = task, landmarks
        self._estimate = Estimator(task, "ff")
        adds: list[set[int]] = [set() for _ in task.atoms]
        for action in range(len(task.actions)):
            for atom in task.add[task.add_at[action] : task.add_at[action + 1]].tolist():
                adds[atom].add(action)
        self._achievers = adds

    def run(self, weight: int | None, limit: int, bound: int | None) -> Found:
        """Search for a plan, with fewer than `bound` actions where that is given, expanding at most `limit` states.

        Without `weight` greedily, else by cost + weight * heuristic.
        """
        task = self.task
        nodes: list[_Node] = []
        node_of_state: dict[bytes, int] = {}
        queues = _Queues()
        lows = [FAR, FAR]
        expanded = 0
        node_and_action: tuple[int, int] | None = (-1, -1)
        while node_and_action is not None:
            number = self._reach(nodes, node_of_state, *node_and_action, bound)
            if number is not None:
                node = nodes[number]
                if node.state[task.goal].all():
                    return Found(_trace(nodes, number), expanded, False)
                if expanded >= limit:
                    return Found(None, expanded, False)
                values = self._estimate(node.state), self.landmarks.left(node.accepted, node.state)
                if values[0] < FAR:
                    expanded += 1
                    if any(value < low for value, low in zip(values, lows, strict=True)):
                        lows = [min(value, low) for value, low in zip(values, lows, strict=True)]
                        queues.boost()
                    self._expand(queues, node, number, values, weight)
            node_and_action = queues.pop()
        return Found(None, expanded, True)

    def _reach(
        self, nodes: list[_Node], node_of_state: dict[bytes, int], parent: int, action: int, bound: int | None
    ) -> int | None:
        """Make the node of an action after a node; None when its state is known as cheaply, or lies over the bound."""
        task = self.task
        if parent < 0:
            state, accepted, cost = task.initial, self.landmarks.first, 0
        else:
            before = nodes[parent]
            cost = before.cost + 1
            if bound is not None and cost >= bound:
                return None
            state = successor(task, before.state, action)
        key = state.tobytes()
        earlier = node_of_state.get(key)
        if earlier is not None and (bound is None or nodes[earlier].cost <= cost):
            return None
        if parent >= 0:
            accepted = self.landmarks.accept(nodes[parent].accepted, state)
        nodes.append(_Node(state, accepted, parent, action, cost))
        node_of_state[key] = len(nodes) - 1
        return len(nodes) - 1

    def _expand(self, queues: _Queues, node: _Node, number: int, values: tuple[int, int], weight: int | None) -> None:
        task = self.task
        landmark_actions: set[int] = set()
        for atom in self.landmarks.achievers_wanted(node.accepted).tolist():
            landmark_actions |= self._achievers[atom]
        key = values if weight is None else (node.cost + weight * values[0], node.cost + weight * values[1])
        for action in applicable(node.state, task.pre, task.pre_at).tolist():
            queues.push(key, number, action, bool(self._estimate.preferred[action]) or action in landmark_actions)


def _trace(nodes: list[_Node], number: int) -> list[int]:
    plan = []
    while nodes[number].parent >= 0:
        plan.append(nodes[number].action)
        number = nodes[number].parent
    return plan[::-1]

"""Heuristic values of states: h_max, h_add and h_FF (Bonet & Geffner 2001, Hoffmann & Nebel 2001)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scenewright.stages.kit.tasks.relaxed import FAR, Relaxed, costs, relaxed_plan

Relaxation = Literal["add", "max", "ff"]


class Estimator:
    """Estimates how many actions states (A,) of a task are from the goal."""

    def __init__(self, task: Relaxed, heuristic: Relaxation) -> None:
        self.task, self.heuristic = task, heuristic
        self.cost = np.empty(len(task.atoms), dtype=np.int64)
        """(A,) of every atom from the last state; FAR is out of reach."""
        self.preferred = np.zeros(len(task.actions), dtype=np.uint8)
        """(N,) actions of the last relaxed plan that can be done at once; by h_FF alone."""
        self._by = np.empty(len(task.atoms), dtype=np.int32)

    def __call__(self, state: np.ndarray) -> int:
        """Return the estimate, FAR when the goal is out of reach even if nothing is ever deleted."""
        task = self.task
        costs(state, task.effects, -1, self.heuristic == "max", self.cost, self._by)
        values = self.cost[task.goal]
        if len(values) == 0 or values.max() >= FAR:
            return FAR if len(values) else 0
        if self.heuristic == "max":
            return int(values.max())
        if self.heuristic == "add":
            return int(values.sum())
        return int(relaxed_plan(state, task.pre, task.pre_at, task.goal, self.cost, self._by, self.preferred))

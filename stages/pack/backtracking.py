"""Rivals that go back in time, not by cause: they read which action failed and nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.pack.records import Action, Attempt, BoxState, Observation
from scenewright.stages.pack.sampling import QUARTER_TURNS, inset_draw, pick_and_place

TRIES = 10
"""Placements tried of a box before the box before it is placed anew."""
CORNER_GAP = 0.003
"""Gap to what a corner is tried at [m]; by eye."""

Place = tuple[float, float, float]


class Backtracking:
    """Chronological backtracking: keeps what worked, draws the failed placement anew, after ten failures goes one back.

    The order of the boxes is drawn once; when even the first box's tries are spent, a new one is drawn. Placements are
    those of `RandomRestarts`.
    """

    name, stream = "backtracking", 4

    def __init__(self, seed: int) -> None:
        self.calls = 0
        self._random = np.random.default_rng([seed, self.stream])
        self._order: list[BoxState] = []
        self._places: list[Place] = []
        self._failures: list[int] = []

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return the plan before up to what failed, and fresh placements from there on."""
        self.calls += 1
        if not self._order:
            self._reorder(observation)
        elif trace:
            self._go_back(trace[-1], observation)
        while len(self._places) < len(self._order):
            self._places.append(self._draw(self._order[len(self._places)], observation))
        pairs = [pick_and_place(box.name, *pose) for box, pose in zip(self._order, self._places, strict=True)]
        return tuple(action for pair in pairs for action in pair)

    def _reorder(self, observation: Observation) -> None:
        self._order = [observation.boxes[int(k)] for k in self._random.permutation(len(observation.boxes))]
        self._places, self._failures = [], [0] * len(self._order)

    def _go_back(self, last: Attempt, observation: Observation) -> None:
        """Cut the plan before its failed action, or one box earlier for every box whose tries are spent."""
        if last.task is not None:
            outside = [k for k, box in enumerate(self._order) if box.name in last.task.objects]
            level = min(outside, default=0)
        else:
            level = (len(last.feedback) - 1) // 2
        if last.feedback and last.feedback[-1].failure is not None and last.feedback[-1].action.name == "pick":
            level -= 1  # another start of the motion, or for the first box another order
        while level >= 0:
            self._failures[level] += 1
            if self._failures[level] < TRIES:
                break
            self._failures[level] = 0
            level -= 1
        if level < 0:
            self._reorder(observation)
            return
        self._places = self._places[:level]
        self._failures[level + 1 :] = [0] * (len(self._order) - level - 1)

    def _draw(self, box: BoxState, observation: Observation) -> Place:
        return inset_draw(box, observation, self._random)


class CornerBacktracking(Backtracking):
    """The same, with placements that touch the basket's sides or boxes that already stand (or fixed obstacles), drawn
    among those free of overlap: geometry as ours has it, without causes."""

    name, stream = "backtracking_corners", 5

    def _draw(self, box: BoxState, observation: Observation) -> Place:
        places = _touching(box, self._order, self._places, observation)
        if places:
            return places[int(self._random.integers(len(places)))]
        return super()._draw(box, observation)


def _extents(box: BoxState, yaw: float) -> tuple[float, float]:
    return (box.width, box.length) if yaw == 0.0 else (box.length, box.width)


def _touching(box: BoxState, order: list[BoxState], places: list[Place], observation: Observation) -> list[Place]:
    """Return the placements in the basket that touch something in x and in y and overlap nothing."""
    low, high = observation.basket.low, observation.basket.high
    occupied = [(*obstacle.low, *obstacle.high) for obstacle in observation.obstacles]
    for placed, (x, y, yaw) in zip(order, places, strict=False):
        half_x, half_y = (side / 2 for side in _extents(placed, yaw))
        occupied.append((x - half_x, y - half_y, x + half_x, y + half_y))
    places_free: list[Place] = []
    for yaw in QUARTER_TURNS:
        half_x, half_y = (side / 2 for side in _extents(box, yaw))
        xs = [low[0] + half_x, high[0] - half_x]
        ys = [low[1] + half_y, high[1] - half_y]
        for left, lower, right, upper in occupied:
            xs += [right + CORNER_GAP + half_x, left - CORNER_GAP - half_x]
            ys += [upper + CORNER_GAP + half_y, lower - CORNER_GAP - half_y]
        for x in xs:
            for y in ys:
                inside = low[0] <= x - half_x + 1e-9 and x + half_x <= high[0] + 1e-9
                inside = inside and low[1] <= y - half_y + 1e-9 and y + half_y <= high[1] + 1e-9
                if inside and all(
                    x + half_x <= left or x - half_x >= right or y + half_y <= lower or y - half_y >= upper
                    for left, lower, right, upper in occupied
                ):
                    places_free.append((x, y, yaw))
    return places_free

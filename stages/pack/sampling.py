"""Proposers that sample: the published random sampler (repaired), the fixed layout, random restarts."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

import numpy as np
from scenewright.stages.pack.records import Action, Attempt, BoxState, Observation

QUARTER_TURNS = (0.0, pi / 2)
"""Turns of a box that are sampled [rad]."""


def pick_and_place(box: str, x: float, y: float, yaw: float) -> tuple[Action, Action]:
    """Return the two actions that bring a box to a pose."""
    return Action("pick", box), Action("place", box, x, y, yaw)


class RandomSampler:
    """The published baseline: a fixed order; x, y uniform over the basket (no inset for the box), yaw U(-pi, pi).

    All placements are drawn anew at each iteration; feedback is not read. Repaired (docs/LLM3.md): the order is
    that of the instance's own boxes, whatever they are called.
    """

    name = "random"

    def __init__(self, seed: int) -> None:
        self.calls = 0
        self._random = np.random.default_rng([seed, 1])

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return a plan with placements drawn anew."""
        self.calls += 1
        plan: list[Action] = []
        low, high = observation.basket.low, observation.basket.high
        for box in observation.boxes:
            x, y = self._random.uniform(low, high).tolist()
            plan += pick_and_place(box.name, x, y, self._random.uniform(-pi, pi))
        return tuple(plan)


class FixedLayout:
    """Sanity floor: four hand-written spots, no search, no look at the instance."""

    name = "fixed_layout"
    SPOTS = ((0.585, 0.06), (0.675, 0.06), (0.585, -0.06), (0.675, -0.06))

    def __init__(self) -> None:
        self.calls = 0

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return the one plan it has (boxes beyond the fourth get no place)."""
        self.calls += 1
        pairs = [
            pick_and_place(box.name, x, y, 0.0) for box, (x, y) in zip(observation.boxes, self.SPOTS, strict=False)
        ]
        return tuple(action for pair in pairs for action in pair)


def inset_draw(box: BoxState, observation: Observation, random: np.random.Generator) -> tuple[float, float, float]:
    """Return a placement (x, y, yaw) uniform over those that keep the box within the basket, yaw 0 or a quarter turn.

    A box that fits in neither way is drawn over the whole basket.
    """
    low, high = observation.basket.low, observation.basket.high
    yaw = QUARTER_TURNS[int(random.integers(2))]
    for angle in (yaw, pi / 2 - yaw):
        half_x = (abs(cos(angle)) * box.width + abs(sin(angle)) * box.length) / 2
        half_y = (abs(sin(angle)) * box.width + abs(cos(angle)) * box.length) / 2
        if low[0] + half_x <= high[0] - half_x and low[1] + half_y <= high[1] - half_y:
            x = random.uniform(low[0] + half_x, high[0] - half_x)
            y = random.uniform(low[1] + half_y, high[1] - half_y)
            return x, y, angle
    x, y = random.uniform(low, high).tolist()
    return x, y, yaw


class RandomRestarts:
    """A stronger sampler: a new order and placements within the basket at quarter turns, all anew at each iteration."""

    name = "random_restarts"

    def __init__(self, seed: int) -> None:
        self.calls = 0
        self._random = np.random.default_rng([seed, 2])

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return a plan with order and placements drawn anew."""
        self.calls += 1
        plan: list[Action] = []
        for number in self._random.permutation(len(observation.boxes)):
            box = observation.boxes[int(number)]
            plan += pick_and_place(box.name, *inset_draw(box, observation, self._random))
        return tuple(plan)

"""The baseline as its tier-2 figure implies: more than one object a trip (Srinivas 2024, table 7.1)."""

from __future__ import annotations

from math import pi

import numpy as np
from scenewright.stages.tableware.actions.grasp import Grasp, grasp
from scenewright.stages.tableware.planning.policy import THESIS, DeclaredPolicy, liftable
from scenewright.stages.tableware.planning.rules import Rules
from scenewright.stages.tableware.world.items import Table


class RandomPile:
    """A random pile whole, or what can be lifted of it."""

    def __init__(self, seed: int, rules: Rules = THESIS) -> None:
        self._rules = rules
        self._random = np.random.default_rng([seed, 74])

    def decide(self, table: Table) -> Grasp:
        """Return a grasp of a random pile."""
        stack = table.stacks[int(self._random.integers(len(table.stacks)))]
        return grasp(table, liftable(table, stack, self._rules), float(self._random.uniform(-pi, pi)))


POLICY = DeclaredPolicy(lambda rules, model, chances, seed: RandomPile(seed, rules), draws=True)

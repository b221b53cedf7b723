"""The baseline, strictly: any item that carries nothing, alone (Srinivas 2024, section 6.4)."""

from __future__ import annotations

from math import pi

import numpy as np
from scenewright.stages.tableware.actions.grasp import Grasp, grasp
from scenewright.stages.tableware.planning.policy import DeclaredPolicy
from scenewright.stages.tableware.world.items import Table


class RandomOne:
    """Any item that carries nothing, a dish at a random point of its rim."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng([seed, 73])

    def decide(self, table: Table) -> Grasp:
        """Return a grasp of a random top item."""
        item = table.tops[int(self._random.integers(len(table.tops)))]
        return grasp(table, item.name, float(self._random.uniform(-pi, pi)))


POLICY = DeclaredPolicy(lambda rules, model, chances, seed: RandomOne(seed), draws=True)

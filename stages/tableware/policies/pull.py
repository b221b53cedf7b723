"""Pull, algorithm 1 of Srinivas 2024, section 6.4."""

from __future__ import annotations

from itertools import permutations

from scenewright.stages.tableware.actions.grasp import grasp, grasp_two
from scenewright.stages.tableware.actions.pull_grasp import pull_grasp
from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.policy import THESIS, DeclaredPolicy, liftable
from scenewright.stages.tableware.planning.rules import Rules, can_grasp_two, can_pull
from scenewright.stages.tableware.world.items import Table


class PullPolicy:
    """What can be grasped in pairs, then what can after a pull, then singly. Pairs in the order seen."""

    def __init__(self, rules: Rules = THESIS) -> None:
        self._rules = rules

    def decide(self, table: Table) -> Action:
        """Return a multi-object grasp, else a pull-grasp, else a grasp."""
        bases = [stack[0].name for stack in table.stacks]
        for first, second in permutations(bases, 2):
            if can_grasp_two(table, first, second, self._rules):
                return grasp_two(table, first, second)
        for first, second in permutations(bases, 2):
            if can_pull(table, first, second, self._rules):
                return pull_grasp(table, first, second, self._rules)
        return grasp(table, liftable(table, table.stacks[0], self._rules))


POLICY = DeclaredPolicy(lambda rules, model, chances, seed: PullPolicy(rules))

"""Stack, algorithm 2 of Srinivas 2024, section 6.4."""

from __future__ import annotations

from scenewright.stages.tableware.actions.grasp import grasp
from scenewright.stages.tableware.actions.stack_grasp import stack_grasp
from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.policy import THESIS, DeclaredPolicy, liftable
from scenewright.stages.tableware.planning.rules import Rules, can_put
from scenewright.stages.tableware.world.items import Table


class StackPolicy:
    """A utensil onto a bowl and both away, one bowl a time as its six trips on tier 1 say; then any two piles; then
    singly."""

    def __init__(self, rules: Rules = THESIS) -> None:
        self._rules = rules

    def decide(self, table: Table) -> Action:
        """Return a stack-grasp, else a grasp."""
        stacks = table.stacks
        lone = [stack for stack in stacks if not stack[0].is_dish]
        bowls = [stack for stack in stacks if any(item.kind == "bowl" for item in stack)]
        for lower in (bowls, stacks):
            for upper in lone if lower is bowls else stacks:
                for base in lower:
                    if upper is not base and can_put(table, upper[0].name, base[0].name, self._rules):
                        return stack_grasp(table, upper[0].name, base[0].name)
        return grasp(table, liftable(table, stacks[0], self._rules))


POLICY = DeclaredPolicy(lambda rules, model, chances, seed: StackPolicy(rules))

"""Who decides what is done next, from what is seen: Random, Pull (Algorithm 1) and Stack (Algorithm 2) of Srinivas
2024, section 6.4. One action is decided for each image."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from math import pi
from typing import Protocol

import numpy as np

from stages.tableware.planning.actions import Action, grasp, grasp_two, pull_grasp, stack_grasp
from stages.tableware.planning.rules import Rules, can_grasp_two, can_hold, can_pull, can_put, letters
from stages.tableware.world.items import Item, Table

THESIS = replace(Rules(), utensils_in_cups=True, both_piles=False)
"""What section 6.2 allows."""


class Policy(Protocol):
    """Decides one action."""

    def decide(self, table: Table) -> Action:
        """Return the next action on a table with at least one item."""
        ...


def liftable(table: Table, stack: tuple[Item, ...], rules: Rules) -> str:
    """Return the lowest thing of a pile that one grasp lifts with all that is on it."""
    return next(item.name for row, item in enumerate(stack) if can_hold(letters(stack[row:]), rules))


class RandomOne:
    """The baseline, strictly: any item that carries nothing, alone, a dish at a random point of its rim."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng([seed, 73])

    def decide(self, table: Table) -> Action:
        """Return a grasp of a random top item."""
        item = table.tops[int(self._random.integers(len(table.tops)))]
        return grasp(table, item.name, float(self._random.uniform(-pi, pi)))


class RandomPile:
    """The baseline as its tier-2 figure implies (1.4 objects a trip): a random pile whole, or what can be lifted of
    it."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng([seed, 74])

    def decide(self, table: Table) -> Action:
        """Return a grasp of a random pile."""
        stack = table.stacks[int(self._random.integers(len(table.stacks)))]
        return grasp(table, liftable(table, stack, THESIS), float(self._random.uniform(-pi, pi)))


class PullPolicy:
    """Algorithm 1: what can be grasped in pairs, then what can after a pull, then singly. Pairs in the order seen."""

    def decide(self, table: Table) -> Action:
        """Return a multi-object grasp, else a pull-grasp, else a grasp."""
        bases = [stack[0].name for stack in table.stacks]
        for first, second in permutations(bases, 2):
            if can_grasp_two(table, first, second, THESIS):
                return grasp_two(table, first, second)
        for first, second in permutations(bases, 2):
            if can_pull(table, first, second, THESIS):
                return pull_grasp(table, first, second, THESIS)
        return grasp(table, liftable(table, table.stacks[0], THESIS))


class StackPolicy:
    """Algorithm 2: a utensil onto a bowl and both away, one bowl a time as its six trips on tier 1 say; then any two
    piles; then singly."""

    def decide(self, table: Table) -> Action:
        """Return a stack-grasp, else a grasp."""
        stacks = table.stacks
        lone = [stack for stack in stacks if not stack[0].is_dish]
        bowls = [stack for stack in stacks if any(item.kind == "bowl" for item in stack)]
        for lower in (bowls, stacks):
            for upper in lone if lower is bowls else stacks:
                for base in lower:
                    if upper is not base and can_put(table, upper[0].name, base[0].name, THESIS):
                        return stack_grasp(table, upper[0].name, base[0].name)
        return grasp(table, liftable(table, stacks[0], THESIS))

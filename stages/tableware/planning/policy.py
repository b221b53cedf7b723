"""What a policy is, and what a file of stages/tableware/policies declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.rules import Rules, can_hold, letters
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.items import Item, Table
from scenewright.stages.tableware.world.setting import Setting

THESIS = replace(Rules(), utensils_in_cups=True, both_piles=False)
"""What section 6.2 (Srinivas 2024) allows."""


STANDARD_SETTING = Setting()


class Policy(Protocol):
    """Decides one action for each image."""

    def decide(self, table: Table) -> Action:
        """Return the next action on a table with at least one item."""
        ...


@dataclass(frozen=True)
class DeclaredPolicy:
    """POLICY of a policy's file; the command line calls it as the file."""

    decides: Callable[[Rules, TimeModel, Chances, int], Policy]
    """From its rules in a setting, the times and chances that it may plan by, and a seed."""
    rules: Rules = THESIS
    """What it allows itself."""
    draws: bool = False
    """Whether it decides by chance: it is then made anew, with another seed, for every draw of what goes wrong."""
    rivals: tuple[str, ...] = ()
    """Policies that it aims to be no slower than, table by table."""

    def rules_in(self, setting: Setting) -> Rules:
        """Return what it allows itself with these sizes and this hand."""
        return replace(self.rules, setting=setting)

    def make(self, model: TimeModel, chances: Chances, seed: int, setting: Setting = STANDARD_SETTING) -> Policy:
        """Return the policy for these sizes and this hand."""
        return self.decides(self.rules_in(setting), model, chances, seed)


def liftable(table: Table, stack: tuple[Item, ...], rules: Rules) -> str:
    """Return the lowest thing of a pile that one grasp lifts with all that is on it."""
    return next(item.name for row, item in enumerate(stack) if can_hold(letters(stack[row:]), rules))

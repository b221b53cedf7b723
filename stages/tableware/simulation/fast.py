"""The fast simulator: actions on a table by their fitted times (time_model.py), in a world with its chances.

What goes wrong, and nothing else does: a pull misses by the measured error, and contact stops a dish that would come to
stand in another; a multi-object grasp whose second pile is out of reach then, or slips, leaves it where it is; an
action may drop something off the table for good, by chances that are 0 unless said. Whatever chance decides follows
from the seed, from what it happens to and from how often that was tried, not from the order of things: all policies
meet the same luck.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import atan2, cos, hypot, pi, sin
from typing import Any
from zlib import crc32

import numpy as np
from scenewright.stages.tableware.actions.grasp import Grasp, taken
from scenewright.stages.tableware.actions.pull import Pull, after_pull
from scenewright.stages.tableware.actions.stack import Stack, after_stack
from scenewright.stages.tableware.planning.action import Action, Primitive
from scenewright.stages.tableware.planning.policy import STANDARD_SETTING, Policy
from scenewright.stages.tableware.planning.rules import Rules, can_grasp_two, can_hold, letters
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel, placement_error
from scenewright.stages.tableware.simulation.trial import Trial, run_in
from scenewright.stages.tableware.world.footprints import footprint, gap, overlapped
from scenewright.stages.tableware.world.items import TABLE_SIDES, Item, Table
from scenewright.stages.tableware.world.setting import Setting


class FastWorld:
    """A table that actions change."""

    def __init__(
        self,
        table: Table,
        model: TimeModel,
        chances: Chances,
        seed: int | tuple[int, ...],
        setting: Setting = STANDARD_SETTING,
    ) -> None:
        self.table = table
        self.trial = Trial(left=len(table.items))
        self._model, self._chances = model, chances
        self._seed = (seed,) if isinstance(seed, int) else seed
        self._tried: Counter[str] = Counter()
        self._rules = Rules(setting)
        self.fallen: list[str] = []
        """Everything that fell off the table, in order."""
        self.troubles: list[str] = []
        """What did not go as planned in the last action."""
        self.vain: tuple[str, ...] = ()
        """What the hand closed on in vain in the last action."""
        self._motions: dict[type[Primitive], Callable[[Any], None]] = {
            Grasp: self._grasp,
            Pull: self._pull,
            Stack: self._stack,
        }

    def _luck(self, what: str, name: str) -> np.random.Generator:
        """Return the generator of one thing that happens to an item, another at each attempt."""
        key = f"{what} {name}"
        self._tried[key] += 1
        return np.random.default_rng([*self._seed, 72, crc32(key.encode()), self._tried[key]])

    def _goes_wrong(self, chance: float, what: str, name: str) -> bool:
        return chance > 0.0 and self._luck(what, name).random() < chance

    def do(self, action: Action, seen: Table | None = None) -> None:
        """Carry out an action, a composite one without looking in between. Items go by their names, whatever was seen:
        what is not there is reached for in vain, and a pile that is more than the jaws hold is dropped."""
        self.troubles, self.vain = [], ()
        for part in action.parts:
            self._motions[type(part)](part)
        self.trial.left = len(self.table.items)

    def _pull(self, action: Pull) -> None:
        self.trial.seconds += self._model.pull
        self.trial.pulls += 1
        if not self._there(action.item, action.target):
            return
        loaded = bool(self.table.carried[action.item])
        chance = self._chances.drop_loaded_pull if loaded else self._chances.drop_pull
        if self._goes_wrong(chance, "pull", action.item):
            self._drop(action.item)
            return
        item, target = self.table.by_name[action.item], self.table.by_name[action.target]
        error = (0.0, 0.0)
        if self._chances.noise:
            length = hypot(action.p_E[0] - action.p_S[0], action.p_E[1] - action.p_S[1])
            error = placement_error(item.kind, length, self._luck("miss", item.name))
        moved = after_pull(self.table, action, error)
        inside = -gap(footprint(moved.by_name[item.name]), footprint(target))
        if inside > 0.0:  # contact stops it on its way
            dx, dy = action.p_E[0] - target.position[0], action.p_E[1] - target.position[1]
            apart = hypot(dx, dy)
            error = (error[0] + inside * dx / apart, error[1] + inside * dy / apart)
            moved = after_pull(self.table, action, error)
        self.table = moved

    def _stack(self, action: Stack) -> None:
        self.trial.seconds += self._model.stack
        self.trial.stacks += 1
        if not self._there(action.item, action.onto):
            return
        if self._goes_wrong(self._chances.drop_stack, "stack", action.item):
            self._drop(action.item)
            return
        self.table = after_stack(self.table, action)

    def _grasp(self, action: Grasp) -> None:
        self.trial.seconds += self._model.whole_trip
        self.trial.trips += 1
        present = tuple(name for name in action.items if name in self.table.by_name)
        self._there(*action.items)
        if len(present) == 2:
            first, second = (self.table.by_name[name] for name in present)
            slips = 1.0 - self._chances.holds(letters((first,)), letters((second,)))
            if not can_grasp_two(self.table, *present, self._rules) or self._goes_wrong(slips, "slip", present[1]):
                self.troubles.append(f"{present[1]} stayed behind")
                present = present[:1]
            elif self._goes_wrong(self._chances.drop_two, "lift", present[1]):
                self._drop(present[1])
                present = present[:1]
            elif self._chances.spills:
                self._spill(first, second)
                self._spill(second, first)
        elif present and self._goes_wrong(self._chances.drop_single, "lift", present[0]):
            self._drop(present[0])
            return
        for name in present:
            if not can_hold(letters((self.table.by_name[name], *self.table.load(name))), self._rules):
                self._drop(name)
                continue
            names = taken(self.table, Grasp((name,), action.p_G, action.theta_G))
            self.trial.moved += len(names)
            self.table = self.table.without(names)

    def _spill(self, base: Item, beside: Item) -> None:
        """Lay the utensils of a dish that is lifted beside another on the table: where there is room next to where it
        stood, on the far side first."""
        away = atan2(base.position[1] - beside.position[1], base.position[0] - beside.position[0])
        for utensil in (item for item in self.table.load(base.name) if base.is_dish and not item.is_dish):
            others = [footprint(item) for item in self.table.items if item.name != utensil.name]
            for reach in np.arange(base.measures.rim_radius, max(TABLE_SIDES), 0.02):
                for turn in sorted(np.linspace(-pi, pi, 16, endpoint=False), key=abs):
                    x = base.position[0] + reach * cos(away + float(turn))
                    y = base.position[1] + reach * sin(away + float(turn))
                    print_ = footprint(utensil, float(x), float(y), utensil.yaw)
                    if print_.on_table and not overlapped((print_,), others).any():
                        break
                else:
                    continue
                self.table = self.table.moved(utensil.name, float(x), float(y))
                self.troubles.append(f"{utensil.name} slid off")
                break

    def _there(self, *names: str) -> bool:
        missing = tuple(name for name in names if name not in self.table.by_name)
        self.vain += missing
        if missing:
            self.troubles.append(f"reached in vain for {' and '.join(missing)}")
        return not missing

    def _drop(self, name: str) -> None:
        names = {name, *(item.name for item in self.table.load(name))}
        self.fallen.extend(sorted(names))
        self.troubles.append(f"{' and '.join(sorted(names))} fell off the table")
        self.trial.dropped += len(names)
        self.table = self.table.without(names)


def run_trial(
    table: Table,
    policy: Policy,
    model: TimeModel,
    chances: Chances,
    seed: int | tuple[int, ...],
    setting: Setting = STANDARD_SETTING,
) -> Trial:
    """Return what a policy came to on a table in the fast simulator, seeing everything."""
    return run_in(FastWorld(table, model, chances, seed, setting), policy)

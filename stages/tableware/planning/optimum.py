"""The best order of trips over a whole table, exactly: dynamic programming over what is left on it.

A trip takes one pile, or two that stand side by side (trip_options.py). f(left) = min over trips of cost + f(left less
the trip); where a grasp of two may lose its second pile, the mean of that and of f with the second pile still there.
Cost is the time model's expected seconds, `worth` seconds for a loss times its chance, and a charge for each trip.
Within a trip the pull comes first, while the dishes are light, then the stackings. Exact for this set of plans when
nothing slips: what else is left counts as obstacle of a pull; only things that stand on the table are pulled or stacked
upon. With slips it leaves out that a second pile that stays may have been stacked upon.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

import numpy as np
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.tableware.planning.rules import Rules, pile_order, split_over_two
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.planning.trip_options import Part, TripOptions, trip_options
from scenewright.stages.tableware.world.items import Table

MOST_ITEMS = 16
"""Most items that the exact optimum takes: its tables have 2^items rows."""
SAME_PLACE = 1e-6
"""Things that stand no farther [m] from where they stood have not moved."""


@dataclass(frozen=True)
class Trip:
    """What happens for one trip: a pull (item, target) or none, stackings (item, onto) in order, the grasp of bases."""

    pull: tuple[str, str] | None
    stacks: tuple[tuple[str, str], ...]
    bases: tuple[str, ...]
    taken: frozenset[str]
    seconds: float
    """When nothing slips."""
    lost: float = 0.0
    """Chance that something falls off the table."""


@dataclass(frozen=True)
class Solution:
    """The best next trip for every set of items that may be left, (2^N,) each: its option's row, and what is still to
    be expected from there on: seconds, trips, losses."""

    option: np.ndarray
    seconds: np.ndarray
    trips: np.ndarray
    lost: np.ndarray


class Optimum:
    """All that one trip can take on one table, made ready; `solve` finds the best order of trips."""

    def __init__(self, table: Table, rules: Rules, model: TimeModel, chances: Chances, worth: float = 0.0) -> None:
        """`worth` [s]: what a loss counts for. Raises UsageError for more than 16 items."""
        count = len(table.items)
        if count > MOST_ITEMS:
            raise UsageError(f"{count} items are too many for the exact optimum", hint=f"at most {MOST_ITEMS}")
        self.table = table
        self._rules, self._worth = rules, worth
        self._options: TripOptions = trip_options(table, rules, model, chances, worth)
        options = self._options
        number_of = np.full(1 << count, -1, dtype=np.int32)
        number_of[options.masks] = np.arange(len(options.masks))
        self._columns = _Options(
            number_of, options.starts, options.seconds, options.lost, options.slips, options.stays, options.blockers
        )
        self._choice_of = np.repeat(np.arange(len(self._options.masks)), np.diff(self._options.starts))
        self._piles = _piles(table)
        self._row = {item.name: number for number, item in enumerate(table.items)}

    @property
    def everything(self) -> int:
        """All items as bits."""
        return (1 << len(self.table.items)) - 1

    def solve(self, per_trip: float = 0.0) -> Solution:
        """Return the best next trip for whatever is left; `per_trip` seconds are charged for each beyond what it
        takes."""
        return Solution(*_solve(self._piles, self._columns, self._worth, per_trip))

    def left_of(self, table: Table) -> int | None:
        """Return what is left of this table as bits; None when something has moved, or was not there."""
        subset = 0
        for item in table.items:
            number = self._row.get(item.name)
            if number is None:
                return None
            before = self.table.items[number]
            apart = hypot(item.position[0] - before.position[0], item.position[1] - before.position[1])
            if before.on != item.on or before.kind != item.kind or apart > SAME_PLACE:
                return None
            if not item.is_dish and abs(item.yaw - before.yaw) > SAME_PLACE:
                return None
            subset |= 1 << number
        return subset

    def trips(self, solution: Solution | None = None, left: int | None = None) -> list[Trip]:
        """Return the trips that clear the table, or what is left of it, in order, when nothing slips."""
        solution = solution or self.solve()
        left = self.everything if left is None else left
        trips = []
        while left:
            option = int(solution.option[left])
            choice = int(self._choice_of[option])
            left &= ~int(self._options.masks[choice])
            trips.append(self._as_trip(choice, option))
        return trips

    def _as_trip(self, choice: int, option: int) -> Trip:
        """Return an option with the names of what is pulled and stacked, in order."""
        options = self._options
        parts = [options.parts[row] for row in options.chosen[choice]]
        first = options.parts[options.first[option]]
        second: Part | None = None if options.second[option] < 0 else options.parts[options.second[option]]
        other_parts = sorted(
            (part for part in parts if part is not first and part is not second), key=lambda part: part.kinds
        )
        if second is None:
            sides: tuple[bool, ...] = (False,) * len(other_parts)
            bases: tuple[str, ...] = (first.items[0].name,)
        else:
            split = split_over_two(first.kinds, second.kinds, tuple(part.kinds for part in other_parts), self._rules)
            assert split is not None  # an option is only made where a split exists
            sides, bases = split, (first.items[0].name, second.items[0].name)
        going = sorted(zip(other_parts, sides, strict=True), key=lambda pair: pile_order(pair[0].kinds, self._rules))
        stacks = tuple((part.items[0].name, bases[1] if side else bases[0]) for part, side in going)
        pull = (bases[0], bases[1]) if options.pulled[option] else None
        item_names = frozenset(item.name for part in parts for item in part.items)
        return Trip(pull, stacks, bases, item_names, float(options.seconds[option]), float(options.lost[option]))


def clear(table: Table, rules: Rules, model: TimeModel, chances: Chances) -> list[Trip]:
    """Return the trips that clear a table in the least expected time [s]. Raises UsageError for more than 16 items."""
    return Optimum(table, rules, model, chances).trips()


def seconds(trips: list[Trip]) -> float:
    """Return the time of a plan when nothing slips [s]."""
    return sum(trip.seconds for trip in trips)


def _piles(table: Table) -> _Piles:
    """Return what stands on what."""
    row = {item.name: number for number, item in enumerate(table.items)}
    below = np.array([0 if item.on is None else 1 << row[item.on] for item in table.items], dtype=np.int64)
    above = np.array([sum(1 << row[loaded.name] for loaded in table.load(item.name)) for item in table.items], np.int64)
    return _Piles(below, above)


@compiled
def _meets(items, masks, others):  # type: ignore[no-untyped-def]
    """Whether the mask of any of a set of items (bits) has a bit in common with `others`."""
    for item in range(masks.shape[0]):  # noqa: SIM110 numba compiles no generators
        if items >> item & 1 and masks[item] & others:
            return True
    return False


class _Piles(NamedTuple):
    """Of each item (N,) the one that it stands on and those that stand above it, as bits."""

    below: np.ndarray
    above: np.ndarray


class _Options(NamedTuple):
    """Which choice (2^N,) takes exactly these items (-1: none), where its options begin (C + 1,), and of each option
    (O,) what TripOptions says."""

    number_of: np.ndarray
    starts: np.ndarray
    seconds: np.ndarray
    lost: np.ndarray
    slips: np.ndarray
    stays: np.ndarray
    blockers: np.ndarray


@compiled
def _solve(piles, options, worth, per_trip):  # type: ignore[no-untyped-def]
    """f over all sets of items that may be left: (2^N,) row of the best option, and from there on seconds, trips,
    losses."""
    below, above = piles
    number_of, starts, seconds, lost, slips, stays, blockers = options
    size = 1 << len(below)
    best = np.full(size, np.inf)
    chosen = np.full(size, -1, np.int64)
    time, trips, losses = np.zeros(size), np.zeros(size), np.zeros(size)
    best[0] = 0.0
    for subset in range(1, size):
        if _meets(subset, below, ~subset):  # something would stand on what has gone
            continue
        part = subset
        while part:
            group = number_of[part]
            remaining = subset & ~part
            if group >= 0 and best[remaining] < best[subset] and not _meets(part, above, remaining):
                for option in range(starts[group], starts[group + 1]):
                    if not blockers[option] & remaining:
                        slip = slips[option]
                        value = seconds[option] + worth * lost[option] + per_trip + best[remaining]
                        if slip > 0.0:
                            value += slip * (best[remaining | stays[option]] - best[remaining])
                        if value < best[subset]:
                            best[subset], chosen[subset] = value, option
                            after_slip = remaining | stays[option]
                            time[subset] = seconds[option] + (1.0 - slip) * time[remaining] + slip * time[after_slip]
                            trips[subset] = 1.0 + (1.0 - slip) * trips[remaining] + slip * trips[after_slip]
                            losses[subset] = lost[option] + (1.0 - slip) * losses[remaining] + slip * losses[after_slip]
            part = (part - 1) & subset
    return chosen, time, trips, losses

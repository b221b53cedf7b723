"""The best order of trips over a whole table, exactly: dynamic programming over what is left on it.

A trip takes one pile, or two that stand side by side. Its cost is the time model's: the trip, a stacking for each part
that is put on another, a pull where the two are not near enough yet, and what a slip would cost (the chance that the
second pile stays, times `slip_cost`). f(left) = min over trips of cost(trip, left) + f(left less the trip).
Within a trip the pull comes first, while the dishes are light, then the stackings. Exact for this set of plans: what
else is left counts as obstacle of a pull; only things that stand on the table are pulled or stacked upon.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from schemas.errors import UsageError
from stages.tableware.planning.rules import (
    Rules,
    can_hold,
    can_pile,
    in_the_way,
    jaws,
    letters,
    pile_order,
    pull_end,
    split_over_two,
    sweep,
    within_jaws,
)
from stages.tableware.planning.time_model import Chances, TimeModel
from stages.tableware.world.footprints import Footprint, footprint
from stages.tableware.world.items import Item, Table

MOST_ITEMS = 16
MOST_DISHES = 6
"""In one grasp: three in each of two piles (section 6.4)."""


@dataclass(frozen=True)
class Part:
    """Things of one pile that are lifted together, lower first."""

    items: tuple[Item, ...]
    kinds: str
    mask: int
    whole: bool
    """Whether the lowest stands on the table."""
    lowest: int
    """Row of the lowest item."""
    dishes: int
    utensils: int


@dataclass(frozen=True)
class Trip:
    """What happens for one trip: a pull (item, target) or none, stackings (item, onto) in order, the grasp of bases."""

    pull: tuple[str, str] | None
    stacks: tuple[tuple[str, str], ...]
    bases: tuple[str, ...]
    taken: frozenset[str]
    seconds: float
    """Expected, with what a slip costs."""


@dataclass(frozen=True)
class _Option:
    """A way of making a trip: what of the rest must not lie in the way."""

    cost: float
    blockers: int
    first: int
    second: int
    """Rows of the parts that stand below; -1: there is one pile."""
    pulled: bool
    alone: float = 0.0
    """Seconds more when the trip leaves nothing on the table: a slip then costs a trip of its own."""


class Optimum:
    """All that one trip can take on one table, made ready; `trips` finds the best order of trips."""

    def __init__(self, table: Table, rules: Rules, model: TimeModel, chances: Chances) -> None:
        """Raises UsageError for more than 16 items."""
        count = len(table.items)
        if count > MOST_ITEMS:
            raise UsageError(f"{count} items are too many for the exact optimum", hint=f"at most {MOST_ITEMS}")
        self._rules = rules
        self._groups = _groups(table, rules, model, chances)
        self._number_of = np.full(1 << count, -1, dtype=np.int32)
        starts = [0]
        costs: list[float] = []
        blockers: list[int] = []
        alone: list[float] = []
        for number, (mask, _, options) in enumerate(self._groups):
            self._number_of[mask] = number
            costs.extend(option.cost for option in options)
            blockers.extend(option.blockers for option in options)
            alone.extend(option.alone for option in options)
            starts.append(len(costs))
        self._starts, self._costs = np.array(starts, dtype=np.int64), np.array(costs, dtype=np.float64)
        self._blockers = np.array(blockers, dtype=np.int64)
        self._alone = np.array(alone, dtype=np.float64)
        self._masks = _masks(table)
        self._count = count

    def trips(self, per_trip: float = 0.0) -> list[Trip]:
        """Return the trips that clear the table in the least expected time [s], in order; `per_trip` seconds are
        charged for each trip beyond what it takes."""
        _, trip, chosen = _solve(
            self._count,
            *self._masks,
            self._number_of,
            self._starts,
            self._costs + per_trip,
            self._blockers,
            self._alone,
        )
        left, trips = (1 << self._count) - 1, []
        while left:
            number = self._number_of[trip[left]]
            mask, parts, options = self._groups[number]
            option = options[chosen[left] - self._starts[number]]
            left &= ~mask
            trips.append(_as_trip(parts, option, option.cost + (0.0 if left else option.alone), self._rules))
        return trips


def clear(table: Table, rules: Rules, model: TimeModel, chances: Chances) -> list[Trip]:
    """Return the trips that clear a table in the least expected time [s]. Raises UsageError for more than 16 items."""
    return Optimum(table, rules, model, chances).trips()


def seconds(trips: list[Trip]) -> float:
    """Return the expected time of a plan [s]."""
    return sum(trip.seconds for trip in trips)


def _masks(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Return for each item which one it stands on and which stand above it, as (N,) bit masks."""
    row = {item.name: number for number, item in enumerate(table.items)}
    below = np.array([0 if item.on is None else 1 << row[item.on] for item in table.items], dtype=np.int64)
    above = np.array([sum(1 << row[other.name] for other in table.load(item.name)) for item in table.items], np.int64)
    return below, above


@njit(cache=True)
def _solve(count, below, above, number_of, starts, costs, blockers, alone):  # type: ignore[no-untyped-def]
    """f over all sets of items that may be left: (2^N,) seconds, mask of the next trip, row of its option."""
    size = 1 << count
    best = np.full(size, np.inf)
    trip = np.zeros(size, np.int64)
    chosen = np.zeros(size, np.int64)
    best[0] = 0.0
    for left in range(1, size):
        stands = True
        for item in range(count):
            if left >> item & 1 and below[item] & ~left:
                stands = False
                break
        if not stands:
            continue
        part = left
        while part:
            group = number_of[part]
            rest = left & ~part
            if group >= 0 and best[rest] < best[left]:
                lifted = True
                for item in range(count):
                    if part >> item & 1 and above[item] & rest:
                        lifted = False
                        break
                if lifted:
                    for option in range(starts[group], starts[group + 1]):
                        if not blockers[option] & rest:
                            value = costs[option] + (best[rest] if rest else alone[option])
                            if value < best[left]:
                                best[left], trip[left], chosen[left] = value, part, option
                            if rest:
                                break  # options of a group stand in order of cost
            part = (part - 1) & left
    return best, trip, chosen


def _groups(
    table: Table, rules: Rules, model: TimeModel, chances: Chances
) -> list[tuple[int, tuple[Part, ...], list[_Option]]]:
    """Return every set of things that one trip can take: mask, its parts, its ways from the cheapest on."""
    pairs = _pairs(table, rules, model, chances)
    found = []
    for parts in _choices(_runs(table, rules), rules):
        mask = sum(part.mask for part in parts)
        options = _options(parts, mask, pairs, rules, model)
        if options:
            found.append((mask, parts, options))
    return found


def _runs(table: Table, rules: Rules) -> list[list[Part]]:
    """Return for each pile the runs of neighbours in it that can be lifted together."""
    row = {item.name: number for number, item in enumerate(table.items)}
    runs = []
    for stack in table.stacks:
        parts = []
        for low in range(len(stack)):
            for high in range(low + 1, len(stack) + 1):
                items = stack[low:high]
                kinds = letters(items)
                if can_hold(kinds, rules):
                    mask = sum(1 << row[item.name] for item in items)
                    utensils = kinds.count("u")
                    lowest = row[items[0].name]
                    parts.append(Part(items, kinds, mask, low == 0, lowest, len(kinds) - utensils, utensils))
        runs.append(parts)
    return runs


def _choices(runs: list[list[Part]], rules: Rules) -> list[tuple[Part, ...]]:
    """Return every choice of at most one part a pile, but for those with more than two piles can hold."""
    choices: list[tuple[tuple[Part, ...], int, int]] = [((), 0, 0)]
    for parts in runs:
        choices += [
            ((*chosen, part), dishes + part.dishes, utensils + part.utensils)
            for chosen, dishes, utensils in choices
            for part in parts
            if dishes + part.dishes <= MOST_DISHES and utensils + part.utensils <= 2 * rules.most_utensils
        ]
    return [chosen for chosen, _, _ in choices if chosen]


@dataclass(frozen=True)
class _Pair:
    """Two things on the table that one grasp could take, the first pulled to the second or as they stand."""

    first: int
    second: int
    """Rows of the items."""
    both: int
    """Mask of the two."""
    blockers: int
    cost: float
    """Seconds beyond the trip and the stackings."""
    pulled: bool
    alone: float
    """Seconds that a slip costs more when nothing else is left to share a trip with."""


def slip_cost(model: TimeModel) -> float:
    """Return what a slip costs [s] while there is more on the table (a trip of its own when there is not): the pile
    that stayed shares a later trip, and as likely as not a pull.

    With chance q of holding, pairs take n / (1 + q) trips for n equal items and slip (1 - q) n / (1 + q) times: over
    the n / 2 trips without slips that is half a trip a slip.
    """
    return (model.whole_trip + model.pull) / 2


def _pairs(table: Table, rules: Rules, model: TimeModel, chances: Chances) -> list[_Pair]:
    """Return the pairs from the cheapest on."""
    row = {item.name: number for number, item in enumerate(table.items)}
    bases = [stack[0] for stack in table.stacks]
    found = []
    for one in bases:
        for other in bases:
            if one is other or one.is_dish != other.is_dish:
                continue
            names = {one.name, other.name}
            slips = 1.0 - chances.holds(letters((one,)), letters((other,)))
            cost = slips * slip_cost(model)
            if within_jaws(one, other, rules):
                if row[one.name] > row[other.name]:
                    continue
                covers: tuple[Footprint, ...] = (jaws(one, other, rules),)
                pulled = False
            else:
                x, y, yaw = pull_end(one, other, rules)
                if not footprint(one, x, y, yaw).on_table:
                    continue
                covers, pulled, cost = sweep(one, other, rules), True, cost + model.pull
            hit = sum(1 << row[item.name] for item in in_the_way(covers, table, names))
            first, second = row[one.name], row[other.name]
            alone = slips * (model.whole_trip - slip_cost(model))
            found.append(_Pair(first, second, 1 << first | 1 << second, hit, cost, pulled, alone))
    return sorted(found, key=lambda pair: pair.cost)


@lru_cache(maxsize=262144)
def _ways(signature: tuple[tuple[str, bool], ...], rules: Rules) -> tuple[str | None, frozenset[tuple[str, str]]]:
    """Return for the kinds of a trip's parts, and whether each stands on the table, which of them all others can be
    stacked on (None: no one), and on which two they can be shared out. Parts that stand on the table come as True."""
    if len(signature) == 1:
        return signature[0][0], frozenset()
    base = None
    two = set()
    for number, (kinds, whole) in enumerate(signature):
        rest = tuple(other for row, (other, _) in enumerate(signature) if row != number)
        if whole and base is None and can_pile(kinds, rest, rules):
            base = kinds
        for second, (others, stands) in enumerate(signature):
            if second != number and whole and stands and (kinds, others) not in two:
                left = tuple(other for row, (other, _) in enumerate(signature) if row not in (number, second))
                if split_over_two(kinds, others, left, rules) is not None:
                    two.add((kinds, others))
    return base, frozenset(two)


def _options(parts: tuple[Part, ...], mask: int, pairs: list[_Pair], rules: Rules, model: TimeModel) -> list[_Option]:
    """Return the ways in which one trip can take these parts, from the cheapest on, none that another makes idle."""
    base, two = _ways(tuple(sorted((part.kinds, part.whole) for part in parts)), rules)
    if len(parts) == 1:
        return [_Option(model.whole_trip, 0, 0, -1, False)]
    options = []
    alone = np.inf
    if base is not None:
        alone = model.whole_trip + (len(parts) - 1) * model.stack
        lowest = next(row for row, part in enumerate(parts) if part.whole and part.kinds == base)
        options.append(_Option(alone, 0, lowest, -1, False))
    if two:
        start = model.whole_trip + (len(parts) - 2) * model.stack
        place = {part.lowest: row for row, part in enumerate(parts) if part.whole}
        for pair in pairs:
            if start + pair.cost >= alone:
                break  # one pile is as cheap, and nothing is in its way
            if pair.both & ~mask or pair.first not in place or pair.second not in place:
                continue
            one, other = place[pair.first], place[pair.second]
            if (parts[one].kinds, parts[other].kinds) not in two:
                continue
            if pair.pulled and (pair.blockers & mask or (len(parts[one].items) > 1 and not rules.loaded_pulls)):
                continue
            blockers = pair.blockers & ~mask
            if not any(option.blockers & ~blockers == 0 for option in options if option.second >= 0):
                options.append(_Option(start + pair.cost, blockers, one, other, pair.pulled, pair.alone))
            if not blockers:
                break
    return sorted(options, key=lambda option: option.cost)


def _as_trip(parts: tuple[Part, ...], option: _Option, expected: float, rules: Rules) -> Trip:
    """Return an option with the names of what is pulled and stacked, in order."""
    first = parts[option.first]
    rest = [part for row, part in enumerate(parts) if row not in (option.first, option.second)]
    rest.sort(key=lambda part: part.kinds)
    taken = frozenset(item.name for part in parts for item in part.items)
    if option.second < 0:
        sides: tuple[bool, ...] = (False,) * len(rest)
        bases: tuple[str, ...] = (first.items[0].name,)
    else:
        split = split_over_two(first.kinds, parts[option.second].kinds, tuple(part.kinds for part in rest), rules)
        assert split is not None  # an option is only made where a split exists
        sides = split
        bases = (first.items[0].name, parts[option.second].items[0].name)
    going = sorted(zip(rest, sides, strict=True), key=lambda pair: pile_order(pair[0].kinds))
    stacks = tuple((part.items[0].name, bases[1] if side else bases[0]) for part, side in going)
    pull = (bases[0], bases[1]) if option.pulled else None
    return Trip(pull, stacks, bases, taken, expected)

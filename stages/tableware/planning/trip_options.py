"""Everything that one trip can take from a table, and in which ways: what the dynamic programme chooses among.

A trip takes one pile, or two that stand side by side; things of other piles are stacked onto them before. A choice is a
set of parts, at most one of each pile. Whether a choice can be taken follows from the kinds of its parts alone (its
signature), so that is asked once for each signature; who can be pulled to whom, and past what, follows from above.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.tableware.planning.rules import (
    Rules,
    can_hold,
    can_pile,
    jaws,
    letters,
    obstructed,
    pull_end,
    split_over_two,
    sweep,
    why_not_pulled,
    within_jaws,
)
from scenewright.stages.tableware.planning.time_model import Chances, TimeModel
from scenewright.stages.tableware.world.footprints import Footprint, footprint, overlapped
from scenewright.stages.tableware.world.items import Item, Table

MOST_DISHES = 6
"""Most dishes in one grasp: three in each of two piles (section 6.4)."""


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


@dataclass(frozen=True)
class TripOptions:
    """Choices and the ways to take them. A choice has the options `starts[c]` to `starts[c + 1]`.

    masks: (C,) items of each choice as bits; parts: (C,) rows of its parts. For each option (O,): seconds; lost: chance
    that something falls off the table; slips: chance that the second pile stays; stays: its items as bits; blockers:
    items that must be gone before; first, second: rows of the parts that stand below (-1: there is one pile); pulled.
    """

    parts: tuple[Part, ...]
    chosen: tuple[tuple[int, ...], ...]
    masks: np.ndarray
    starts: np.ndarray
    seconds: np.ndarray
    lost: np.ndarray
    slips: np.ndarray
    stays: np.ndarray
    blockers: np.ndarray
    first: np.ndarray
    second: np.ndarray
    pulled: np.ndarray


def trip_options(table: Table, rules: Rules, model: TimeModel, chances: Chances, worth: float) -> TripOptions:
    """Return all that a trip can take. An option that a cheaper one makes idle is left out; `worth` [s] is what a loss
    counts for there."""
    runs = _runs(table, rules)
    parts = tuple(part for run in runs for part in run)
    types = {key: number for number, key in enumerate(sorted({(part.kinds, part.whole) for part in parts}))}
    type_of = np.array([types[part.kinds, part.whole] for part in parts], dtype=np.int64)
    chosen, masks, signatures, ways_of_signature = _choices(runs, type_of.tolist(), list(types), rules)
    longest = max((len(rows) for rows in chosen), default=1)
    rows = np.full((len(chosen), longest), -1, dtype=np.int64)
    for number, choice in enumerate(chosen):
        rows[number, : len(choice)] = choice
    bases = np.full(len(ways_of_signature), -1, dtype=np.int64)
    two = np.zeros((len(ways_of_signature), len(types), len(types)), dtype=np.bool_)
    for number, (base, pairs) in enumerate(ways_of_signature):
        if base is not None:
            bases[number] = types.get((base, True), types.get((base, False), -1))
        for upper, lower in pairs:
            two[number, types[upper, True], types[lower, True]] = True
    costs = _Costs(
        float(model.whole_trip),
        float(model.stack),
        float(chances.drop_stack),
        float(chances.drop_single),
        float(chances.drop_two),
        float(chances.drop_loaded_pull),
        float(worth),
    )
    columns = _Parts(
        np.array([part.lowest for part in parts], np.int64),
        np.array([part.whole for part in parts], np.bool_),
        np.array([len(part.items) for part in parts], np.int64),
        np.array([part.mask for part in parts], np.int64),
        type_of,
        np.array([why_not_pulled(part.kinds, rules) is None for part in parts], np.bool_),
    )
    choices = _Choices(rows, np.array([len(choice) for choice in chosen], np.int64), masks, signatures)
    neighbours = _pairs(table, rules, model, chances, worth)
    starts, ways = _ways_of(choices, _Signatures(bases, two), columns, neighbours, costs)
    return TripOptions(
        parts, tuple(chosen), masks, starts, *(np.ascontiguousarray(ways[name]) for name in WAY.names or ())
    )


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
                    parts.append(Part(items, kinds, mask, low == 0, row[items[0].name]))
        runs.append(parts)
    return runs


Ways = tuple[str | None, frozenset[tuple[str, str]]]
"""On which kind of part all others of a signature can be stacked, and on which two they can be shared out."""


def _choices(
    runs: list[list[Part]], type_of: list[int], types: list[tuple[str, bool]], rules: Rules
) -> tuple[list[tuple[int, ...]], np.ndarray, np.ndarray, list[Ways]]:
    """Return every choice that some way can take: rows of its parts, its mask, its signature; and for each signature
    what `_ways` says."""
    follow: dict[tuple[int, int], int] = {}
    signature_of: dict[tuple[int, ...], int] = {(): 0}
    signatures: list[tuple[int, ...]] = [()]
    choices: list[tuple[tuple[int, ...], int, int, int, int]] = [((), 0, 0, 0, 0)]
    row = 0
    for run in runs:
        before = len(choices)
        for part in run:
            utensils = part.kinds.count("u")
            dishes = len(part.kinds) - utensils
            most_dishes, most_utensils = MOST_DISHES - dishes, 2 * rules.most_utensils - utensils
            kind = type_of[row]
            for chosen, mask, signature, has_dishes, has_utensils in choices[:before]:
                if has_dishes <= most_dishes and has_utensils <= most_utensils:
                    step = (signature, kind)
                    number = follow.get(step)
                    if number is None:
                        after = tuple(sorted((*signatures[signature], kind)))
                        number = signature_of.setdefault(after, len(signatures))
                        if number == len(signatures):
                            signatures.append(after)
                        follow[step] = number
                    choices.append(
                        ((*chosen, row), mask | part.mask, number, has_dishes + dishes, has_utensils + utensils)
                    )
            row += 1
    ways = [_ways(tuple(sorted(types[kind] for kind in signature)), rules) for signature in signatures]
    kept = [choice for choice in choices[1:] if ways[choice[2]][0] is not None or ways[choice[2]][1]]
    masks = np.array([mask for _, mask, *_ in kept], dtype=np.int64)
    numbers = np.array([number for _, _, number, *_ in kept], dtype=np.int64)
    return [chosen for chosen, *_ in kept], masks, numbers, ways


@lru_cache(maxsize=262144)
def _ways(signature: tuple[tuple[str, bool], ...], rules: Rules) -> Ways:
    """Return for the kinds of a choice's parts, and whether each stands on the table, which of them all others can be
    stacked on (None: no one), and on which two they can be shared out."""
    if not signature:
        return None, frozenset()
    if len(signature) == 1:
        return signature[0][0], frozenset()
    base = None
    two = set()
    tried = set()
    for number, (kinds, whole) in enumerate(signature):
        if not whole or (number and signature[number - 1] == (kinds, whole)):
            continue
        rest = tuple(other for row, (other, _) in enumerate(signature) if row != number)
        if base is None and can_pile(kinds, rest, rules):
            base = kinds
        for second, (others, stands) in enumerate(signature):
            if second != number and stands and (kinds, others) not in tried:
                tried.add((kinds, others))
                left = tuple(other for row, (other, _) in enumerate(signature) if row not in (number, second))
                if split_over_two(kinds, others, left, rules) is not None:
                    two.add((kinds, others))
    return base, frozenset(two)


def _pairs(table: Table, rules: Rules, model: TimeModel, chances: Chances, worth: float) -> _Pairs:
    """Return the pairs that one grasp could take."""
    row = {item.name: number for number, item in enumerate(table.items)}
    pile = {item.name: stack[0].name for stack in table.stacks for item in stack}
    bases = [stack[0] for stack in table.stacks]
    pairs: list[_Pair] = []
    covers: list[Footprint] = []
    owners: list[int] = []
    for base in bases:
        for other in bases:
            if base is other or base.is_dish != other.is_dish:
                continue
            slips = 1.0 - chances.holds(letters((base,)), letters((other,)))
            first, second = row[base.name], row[other.name]
            if within_jaws(base, other, rules):
                if first > second:
                    continue
                places: tuple[Footprint, ...] = (jaws(base, other, rules),)
                pulled, cost, lost = False, 0.0, 0.0
            else:
                if not footprint(base, *pull_end(base, other, rules)).on_table:
                    continue
                places, pulled, cost, lost = sweep(base, other, rules), True, model.pull, chances.drop_pull
            if obstructed(places, table):
                continue
            owners.extend([len(pairs)] * len(places))
            covers.extend(places)
            pairs.append(_Pair(first, second, cost, lost, slips, pulled))
    blockers = np.zeros(len(pairs), dtype=np.int64)
    if covers:
        hits = overlapped(covers, [footprint(item) for item in table.items])
        for owner, hit in zip(owners, hits, strict=True):
            blockers[owner] |= sum(1 << int(item) for item in np.flatnonzero(hit))
    own = {base.name: sum(1 << row[name] for name, lowest in pile.items() if lowest == base.name) for base in bases}
    for number, pair in enumerate(pairs):
        blockers[number] &= ~(own[table.items[pair.first].name] | own[table.items[pair.second].name])
    slip = slip_cost(model)
    order = sorted(range(len(pairs)), key=lambda n: pairs[n].seconds + worth * pairs[n].lost + pairs[n].slips * slip)
    ordered = [pairs[number] for number in order]
    return _Pairs(
        np.array([pair.first for pair in ordered], np.int64),
        np.array([pair.second for pair in ordered], np.int64),
        blockers[np.array(order, np.int64)],
        np.array([pair.seconds for pair in ordered], np.float64),
        np.array([pair.lost for pair in ordered], np.float64),
        np.array([pair.slips for pair in ordered], np.float64),
        np.array([pair.pulled for pair in ordered], np.bool_),
    )


class _Pair(NamedTuple):
    """Rows of two things, seconds beyond the trip, chances of a loss and of a slip, whether the first is pulled."""

    first: int
    second: int
    seconds: float
    lost: float
    slips: float
    pulled: bool


def slip_cost(model: TimeModel) -> float:
    """Return about what a slip costs [s] while there is more on the table, by which pairs are put in order: the pile
    that stayed shares a later trip, and as likely as not a pull.

    With chance q of holding, pairs take n / (1 + q) trips for n equal items and slip (1 - q) n / (1 + q) times: over
    the n / 2 trips without slips that is half a trip a slip.
    """
    return (model.whole_trip + model.pull) / 2


class _Choices(NamedTuple):
    """Of each choice (C,): rows of its parts (C, P; -1: none), their number, its items as bits, its signature (S of
    them)."""

    rows: np.ndarray
    counts: np.ndarray
    masks: np.ndarray
    signatures: np.ndarray


class _Signatures(NamedTuple):
    """Of each signature: the type of part that all others can be stacked on (S,; -1: none), and which two types they
    can be shared out on (S, T, T)."""

    bases: np.ndarray
    two: np.ndarray


class _Parts(NamedTuple):
    """Of each part (P,): row of its lowest item, whether that stands on the table, number of items, these as bits, its
    type, whether it may be pulled."""

    lowest: np.ndarray
    whole: np.ndarray
    length: np.ndarray
    masks: np.ndarray
    types: np.ndarray
    pullable: np.ndarray


class _Pairs(NamedTuple):
    """Of each pair that one grasp could take, the first pulled to the second or as they stand, (P,) from the cheapest
    on: rows of both, what must be gone before as bits, seconds beyond the trip, chances of a loss and of a slip,
    whether the first is pulled."""

    first: np.ndarray
    second: np.ndarray
    blockers: np.ndarray
    seconds: np.ndarray
    lost: np.ndarray
    slips: np.ndarray
    pulled: np.ndarray


class _Costs(NamedTuple):
    """Seconds, chances of a loss, what a loss counts for [s]."""

    whole_trip: float
    stack: float
    drop_stack: float
    drop_single: float
    drop_two: float
    drop_loaded: float
    worth: float


WAY = np.dtype(
    [
        ("seconds", np.float64),
        ("lost", np.float64),
        ("slips", np.float64),
        ("stays", np.int64),
        ("blockers", np.int64),
        ("first", np.int64),
        ("second", np.int64),
        ("pulled", np.bool_),
    ],
    align=True,
)
"""One option, see TripOptions."""


@compiled
def _base(rows: np.ndarray, count: int, kind: int, parts: _Parts) -> int:
    """Return which of a choice's parts all others are stacked on, one of type `kind` on the table (-1: none)."""
    if count == 1:
        return rows[0]  # type: ignore[no-any-return]
    for k in range(count):
        if parts.whole[rows[k]] and parts.types[rows[k]] == kind:
            return rows[k]  # type: ignore[no-any-return]
    return -1


@compiled
def _standing_on(rows: np.ndarray, count: int, one: int, other: int, parts: _Parts) -> tuple[int, int]:
    """Return which of a choice's parts stand on the table by either of two items (-1: none)."""
    first = second = -1
    for k in range(count):
        part = rows[k]
        if parts.whole[part] and parts.lowest[part] == one:
            first = part
        if parts.whole[part] and parts.lowest[part] == other:
            second = part
    return first, second


@compiled
def _is_idle(ways: np.ndarray, begin: int, last: int, worth: float) -> bool:
    """Whether way `last`, a grasp of two, is no better in anything than one of the ways from `begin` on."""
    way = ways[last]
    cost = way.seconds + worth * way.lost
    for number in range(begin, last):
        other = ways[number]
        if (
            other.second >= 0
            and other.blockers & ~way.blockers == 0
            and other.slips <= way.slips
            and other.seconds + worth * other.lost <= cost
        ):
            return True
    return False


@compiled
def _ways_of(
    choices: _Choices, kinds: _Signatures, parts: _Parts, pairs: _Pairs, costs: _Costs
) -> tuple[np.ndarray, np.ndarray]:
    """Return starts (C + 1,) and the options of all choices, of type WAY."""
    worth = costs.worth
    starts = np.zeros(len(choices.rows) + 1, np.int64)
    ways, made = np.zeros(64, WAY), 0
    for choice in range(len(choices.rows)):
        begin, mask, signature = made, choices.masks[choice], choices.signatures[choice]
        rows, count = choices.rows[choice], choices.counts[choice]
        if made + len(pairs.first) + 1 >= len(ways):
            more = np.zeros(2 * (len(ways) + len(pairs.first) + 1), WAY)
            more[:made] = ways[:made]
            ways = more
        alone = np.inf
        base = _base(rows, count, kinds.bases[signature], parts)
        if base >= 0:
            way = ways[made]
            way.seconds = costs.whole_trip + (count - 1) * costs.stack
            way.lost = costs.drop_single + (count - 1) * costs.drop_stack
            way.slips, way.stays, way.blockers = 0.0, 0, 0
            way.first, way.second, way.pulled = base, -1, False
            alone = way.seconds + worth * way.lost
            made += 1
        if count > 1 and kinds.two[signature].any():
            start = costs.whole_trip + (count - 2) * costs.stack
            risk = costs.drop_two + (count - 2) * costs.drop_stack
            for pair in range(len(pairs.first)):
                if start + pairs.seconds[pair] + worth * (risk + pairs.lost[pair]) >= alone:
                    continue
                if (1 << pairs.first[pair] | 1 << pairs.second[pair]) & ~mask:
                    continue
                first, second = _standing_on(rows, count, pairs.first[pair], pairs.second[pair], parts)
                if first < 0 or second < 0 or not kinds.two[signature, parts.types[first], parts.types[second]]:
                    continue
                pulled = pairs.pulled[pair]
                if pulled and (pairs.blockers[pair] & mask or not parts.pullable[first]):
                    continue
                loaded = pulled and parts.length[first] > 1
                way = ways[made]
                way.seconds = start + pairs.seconds[pair]
                way.lost = risk + (costs.drop_loaded if loaded else pairs.lost[pair])
                way.slips, way.stays, way.blockers = (
                    pairs.slips[pair],
                    parts.masks[second],
                    pairs.blockers[pair] & ~mask,
                )
                way.first, way.second, way.pulled = first, second, pulled
                if not _is_idle(ways, begin, made, worth):
                    made += 1
        starts[choice + 1] = made
    return starts, ways[:made]

"""What may be grasped, pulled and stacked (Srinivas 2024, section 6.2), from the kinds in a pile and from above.

A pile is a string, lower things first: `p` plate, `b` bowl, `c` cup, `u` utensil. A rule that the thesis leaves open is
named as ours where it stands.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from math import atan2, cos, hypot, pi, sin
from typing import Literal

import numpy as np
from scenewright.stages.tableware.planning import pulled_load
from scenewright.stages.tableware.planning.pulled_load import NotPulled
from scenewright.stages.tableware.world.footprints import Footprint, footprint, gap, overlapped, swept_disc
from scenewright.stages.tableware.world.items import Item, Kind, Measures, Table, rise
from scenewright.stages.tableware.world.setting import Setting

LETTERS: dict[Kind, str] = {"plate": "p", "bowl": "b", "cup": "c", "fork": "u", "spoon": "u"}
_KINDS: dict[str, Kind] = {"p": "plate", "b": "bowl", "c": "cup", "u": "fork"}


@dataclass(frozen=True)
class Rules:
    """The sizes of things and the hand, and what a policy dares [m, rad]."""

    setting: Setting = Setting()
    similar: float = 0.005
    """Greatest difference of two grasp heights in a multi-object grasp: the thesis's adjustable threshold, without a
    number there. At 0.005 (like with like) Pull comes nearer to the thesis's times of tiers 1 and 2 than at 0.02
    (tuning seeds 0 to 39)."""
    parallel: float = pi / 6
    """Greatest angle between two utensils that are grasped together (ours)."""
    pull_gap: float = 0.01
    """Distance between rims or utensils that a pull aims at (ours)."""
    most_utensils: int = 4
    """Utensils in one pile (ours)."""
    utensils_in_cups: bool = False
    """Whether utensils are put on cups; the thesis allows any dish. One that lies there already may stay."""
    plates_alone: bool = False
    """Whether a plate is lifted only with nothing on it (ours)."""
    loaded_pulls: bool = True
    """Whether a dish that carries others may be pulled."""
    steady_pulls: bool = False
    """Whether only what bears it is pulled (pulled_load.py, ours); the thesis pulls whatever one grasp takes then."""
    both_piles: bool = True
    """Whether more is stacked onto a pair of dishes that stand side by side, before one grasp takes all (ours)."""
    beside: frozenset[tuple[str, str]] | None = None
    """The pairs of piles, in the order of their letters, that are lifted side by side; None: all that the jaws hold
    (ours). Dishes that carry utensils are `laden_beside`'s."""
    laden_beside: bool = True
    """Whether dishes that carry utensils are lifted beside others as they stand (ours)."""

    def __post_init__(self) -> None:
        values = tuple(getattr(self, field.name) for field in fields(self))
        object.__setattr__(self, "_hash", hash(values))

    def __hash__(self) -> int:
        """Taken once: rules are part of the key of everything that is remembered below."""
        return self._hash  # type: ignore[attr-defined, no-any-return]


def _measures(letter: str, rules: Rules) -> Measures:
    return rules.setting.sizes[_KINDS[letter]]


def letters(items: Iterable[Item]) -> str:
    """Return the pile of some items, lower things first."""
    return "".join(LETTERS[item.kind] for item in items)


@lru_cache(maxsize=4096)
def lips(pile: str, rules: Rules) -> tuple[float, ...]:
    """Return the heights [m] of the dishes' lips over the lowest one's foot."""
    foot, heights = 0.0, []
    for number, kind in enumerate(pile):
        if number:
            foot += rise(_measures(kind, rules), _measures(pile[number - 1], rules))
        if kind != "u":
            heights.append(foot + _measures(kind, rules).height)
    return tuple(heights)


@lru_cache(maxsize=65536)
def can_hold(pile: str, rules: Rules) -> bool:
    """Return whether one grasp lifts the whole pile: its lips differ by no more than the jaws' height (section 6.4)."""
    if rules.plates_alone and "p" in pile and len(pile) > 1:
        return False
    heights = lips(pile, rules)
    spread = max(heights) - min(heights) if heights else 0.0
    return spread <= rules.setting.gripper.jaw_height and pile.count("u") <= rules.most_utensils


@lru_cache(maxsize=65536)
def can_hold_two(first: str, second: str, rules: Rules) -> bool:
    """Return whether one grasp lifts two piles that stand side by side: similar grasp heights (the lowest lips), and
    all lips between the jaws. Utensils go with utensils only."""
    if not (can_hold(first, rules) and can_hold(second, rules)):
        return False
    alike = rules.setting.alike
    if alike is not None and not alike.issuperset(first + second):
        return False
    if any(pile[0] != "u" and "u" in pile for pile in (first, second)):
        if not rules.laden_beside:
            return False
    elif rules.beside is not None and (min(first, second), max(first, second)) not in rules.beside:
        return False
    lips_of_first, lips_of_second = lips(first, rules), lips(second, rules)
    if not lips_of_first or not lips_of_second:
        return not lips_of_first and not lips_of_second
    heights = (*lips_of_first, *lips_of_second)
    return (
        abs(lips_of_first[0] - lips_of_second[0]) <= rules.similar
        and max(heights) - min(heights) <= rules.setting.gripper.jaw_height
    )


@lru_cache(maxsize=4096)
def why_not_pulled(pile: str, rules: Rules) -> Literal["loaded"] | NotPulled | None:
    """Return why a pile may not be pulled, whereto ever; None where it may. A utensil is carried, and always may."""
    if len(pile) > 1 and not rules.loaded_pulls:
        return "loaded"
    if not rules.steady_pulls or pile[0] == "u":
        return None
    return pulled_load.why_not_pulled(tuple(_KINDS[letter] for letter in pile), rules.setting)


@lru_cache(maxsize=65536)
def can_stack(upper: str, lower: str, rules: Rules) -> bool:
    """Return whether one pile may be put on another: no wider than what it comes to stand on (section 6.2), no dish on
    a utensil, and only what can be lifted and held afterwards (ours)."""
    top, bottom = lower[-1], upper[0]
    if bottom == "u":
        fits = top != "c" or rules.utensils_in_cups
    else:
        fits = top != "u" and _measures(bottom, rules).rim_radius <= _measures(top, rules).rim_radius
    return rules.setting.stacking and fits and can_hold(upper, rules) and can_hold(lower + upper, rules)


@lru_cache(maxsize=4096)
def pile_order(part: str, rules: Rules) -> tuple[bool, bool, float, float]:
    """What goes lower sorts first: dishes, dishes that carry utensils, utensils; the wider first."""
    bare = part.rstrip("u")
    if not bare:
        return (True, True, 0.0, 0.0)
    return (False, bare != part, -_measures(bare[0], rules).rim_radius, -_measures(bare[-1], rules).rim_radius)


@lru_cache(maxsize=65536)
def can_pile(base: str, parts: tuple[str, ...], rules: Rules) -> bool:
    """Return whether all parts can be stacked onto `base`, in the order of `pile_order`. No other order does better:
    widths must fall from the foot to the top, and utensils end a pile."""
    pile = base
    for part in sorted(parts, key=lambda part: pile_order(part, rules)):
        if not can_stack(part, pile, rules):
            return False
        pile += part
    return can_hold(pile, rules)


@lru_cache(maxsize=262144)
def split_over_two(first: str, second: str, parts: tuple[str, ...], rules: Rules) -> tuple[bool, ...] | None:
    """Return which parts go onto `second` (True) so that one grasp lifts both piles, None where no split does.
    Utensils lie side by side alone: their piles get nothing more."""
    if parts and not rules.both_piles:
        return None
    if parts and rules.beside is not None and rules.laden_beside:
        rules = replace(rules, laden_beside=False)
    kinds = tuple(sorted(set(parts), key=lambda part: pile_order(part, rules)))
    numbers = _share_out(first, second, kinds, tuple(parts.count(kind) for kind in kinds), rules)
    if numbers is None:
        return None
    left_of_kind = dict(zip(kinds, numbers, strict=True))
    sides = []
    for part in parts:
        sides.append(left_of_kind[part] > 0)
        left_of_kind[part] -= 1
    return tuple(sides)


def _share_out(
    low: str, high: str, kinds: tuple[str, ...], counts: tuple[int, ...], rules: Rules
) -> tuple[int, ...] | None:
    """Return how many of each kind of part, in the order of `pile_order`, go onto `high`, the others onto `low`."""
    if not kinds:
        return () if can_hold_two(low, high, rules) else None
    lows, highs = (_growing_piles(pile, kinds[0], counts[0], rules) for pile in (low, high))
    for number in range(counts[0] + 1):
        if counts[0] - number < len(lows) and number < len(highs):
            shares_of_rest = _share_out(lows[counts[0] - number], highs[number], kinds[1:], counts[1:], rules)
            if shares_of_rest is not None:
                return (number, *shares_of_rest)
    return None


def _growing_piles(pile: str, part: str, count: int, rules: Rules) -> list[str]:
    """Return the pile with 0, 1, ... `count` parts on it, as far as that goes."""
    piles = [pile]
    while len(piles) <= count and can_stack(part, piles[-1], rules):
        piles.append(piles[-1] + part)
    return piles


def within_jaws(first: Item, second: Item, rules: Rules) -> bool:
    """Return whether two things on the table are near enough for one grasp: dishes by the walls that face each other,
    utensils by their middles and directions."""
    if first.is_dish != second.is_dish:
        return False
    if first.is_dish:
        walls = first.measures.wall + second.measures.wall
        return gap(footprint(first), footprint(second)) + walls <= rules.setting.gripper.opening
    apart = hypot(first.position[0] - second.position[0], first.position[1] - second.position[1])
    turned = abs((first.yaw - second.yaw + pi / 2) % pi - pi / 2)
    return (
        apart + max(first.measures.width, second.measures.width) <= rules.setting.gripper.opening
        and turned <= rules.parallel
    )


def grasp_centre(first: Item, second: Item) -> tuple[float, float, float]:
    """Return x, y [m] of the middle of a grasp of two things, and the direction in which the jaws close [rad]."""
    dx, dy = second.position[0] - first.position[0], second.position[1] - first.position[1]
    apart = max(hypot(dx, dy), 1e-9)
    reach = (first.measures.rim_radius + apart - second.measures.rim_radius) / 2 / apart
    return first.position[0] + dx * reach, first.position[1] + dy * reach, atan2(dy, dx)


def jaws(first: Item, second: Item, rules: Rules) -> Footprint:
    """Return what open jaws cover from above as they go down over two things."""
    x, y, angle = grasp_centre(first, second)
    dx, dy = rules.setting.gripper.opening / 2 * cos(angle), rules.setting.gripper.opening / 2 * sin(angle)
    return Footprint((x - dx, y - dy), (x + dx, y + dy), rules.setting.gripper.finger)


def pull_end(item: Item, target: Item, rules: Rules) -> tuple[float, float, float]:
    """Return x, y [m] and yaw [rad] where a pull to `target` ends: `pull_gap` from it, on the item's own side; a
    utensil alongside."""
    dx, dy = item.position[0] - target.position[0], item.position[1] - target.position[1]
    if item.is_dish:
        apart = max(hypot(dx, dy), 1e-9)
        reach = (item.measures.rim_radius + target.measures.rim_radius + rules.pull_gap) / apart
        return target.position[0] + dx * reach, target.position[1] + dy * reach, item.yaw
    across = (-sin(target.yaw), cos(target.yaw))
    side = 1.0 if dx * across[0] + dy * across[1] >= 0.0 else -1.0
    reach = side * ((item.measures.width + target.measures.width) / 2 + rules.pull_gap)
    return target.position[0] + reach * across[0], target.position[1] + reach * across[1], target.yaw


def sweep(item: Item, target: Item, rules: Rules) -> tuple[Footprint, ...]:
    """Return what a pull of `item` to `target` covers from above, and the jaws that then close on both: nothing else
    may lie there (section 6.2; the jaws are ours)."""
    x, y, yaw = pull_end(item, target, rules)
    closing = jaws(replace(item, position=(x, y, item.position[2]), yaw=yaw), target, rules)
    if item.is_dish:
        return swept_disc(item, x, y), closing
    turn = (yaw - item.yaw + pi / 2) % pi - pi / 2
    dx, dy = x - item.position[0], y - item.position[1]
    steps = max(2, int(hypot(dx, dy) / (item.measures.width / 2)) + 1)
    shares = [step / steps for step in range(1, steps + 1)]
    on_the_way = (
        footprint(item, item.position[0] + share * dx, item.position[1] + share * dy, item.yaw + share * turn)
        for share in shares
    )
    return (*on_the_way, closing)


def in_the_way(covers: Iterable[Footprint], table: Table, apart_from: set[str]) -> tuple[Item, ...]:
    """Return the items that any of `covers` overlaps, less those of the piles that `apart_from` stand in."""
    items = [item for stack in table.stacks if not any(member.name in apart_from for member in stack) for item in stack]
    if not items:
        return ()
    hits: np.ndarray = overlapped(tuple(covers), [footprint(item) for item in items])
    return tuple(items[row] for row in np.flatnonzero(hits.sum(axis=0)))


def obstructed(covers: Iterable[Footprint], table: Table) -> bool:
    """Return whether any of `covers` touches something that is not understood."""
    if not table.obstacles:
        return False
    circles = [Footprint((x, y), (x, y), size) for x, y, size in table.obstacles]
    return bool(overlapped(tuple(covers), circles).any())


def can_grasp_two(table: Table, first: str, second: str, rules: Rules) -> bool:
    """Return whether one grasp takes two things that stand on the table, with their loads, as they are now."""
    base, beside = table.by_name[first], table.by_name[second]
    if first == second or base.on is not None or beside.on is not None or not within_jaws(base, beside, rules):
        return False
    piles = letters((base, *table.load(first))), letters((beside, *table.load(second)))
    covers = (jaws(base, beside, rules),)
    if not can_hold_two(*piles, rules) or obstructed(covers, table):
        return False
    return not in_the_way(covers, table, {first, second})


def can_pull(table: Table, item: str, target: str, rules: Rules) -> bool:
    """Return whether a thing may be pulled to another: one grasp could take both there, and nothing lies between."""
    pulled, aim = table.by_name[item], table.by_name[target]
    if item == target or pulled.on is not None or aim.on is not None or pulled.is_dish != aim.is_dish:
        return False
    pile = letters((pulled, *table.load(item)))
    if why_not_pulled(pile, rules) is not None:
        return False
    if not can_hold_two(pile, letters((aim, *table.load(target))), rules):
        return False
    x, y, yaw = pull_end(pulled, aim, rules)
    if not footprint(pulled, x, y, yaw).on_table:
        return False
    covers = sweep(pulled, aim, rules)
    return not obstructed(covers, table) and not in_the_way(covers, table, {item, target})


def can_put(table: Table, item: str, onto: str, rules: Rules) -> bool:
    """Return whether a thing with its load may be put onto the pile that `onto` stands in."""
    base = next(stack for stack in table.stacks if any(member.name == onto for member in stack))
    if any(member.name == item for member in base):
        return False
    return can_stack(letters((table.by_name[item], *table.load(item))), letters(base), rules)

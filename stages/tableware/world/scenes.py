"""Seeded tables of the thesis's three tiers (Srinivas 2024, section 7.1, Scene Generation) and of a fourth of ours.

Every item's x and y are uniform over the table. Where it would touch another it is stacked on it while the tier's
allowance of intersections lasts, else its place is drawn again. Items are placed from the widest to the narrowest, so
that what comes later may always stand on what is there. Tuning takes seeds 0 to 499, reporting seeds 1000 and up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import atan2, cos, hypot, pi, sin

import numpy as np
from scenewright.schemas.errors import UsageError
from scenewright.stages.tableware.world.footprints import Footprint, footprint, gap
from scenewright.stages.tableware.world.items import (
    STANDARD,
    DishSizes,
    Item,
    Kind,
    Table,
    make_item,
    radius,
    stand_height,
)

ORDER: tuple[Kind, ...] = ("plate", "bowl", "cup", "fork", "spoon")
APART = 0.002
"""Least distance [m] of items that do not touch."""
TRIES = 2000
"""Draws of one item's place before the whole table is begun again."""


@dataclass(frozen=True)
class Tier:
    """How many of what, how many intersections become stacks, how high stacks get, which share is pushed together."""

    counts: Mapping[Kind, int]
    intersections: int = 0
    highest: int = 1
    touching: float = 0.0


MIXED: dict[Kind, int] = {"bowl": 4, "cup": 4, "fork": 2, "spoon": 2}
"""Kind -> number of items on a table of tiers 1 and 2."""
TIERS: dict[str, Tier] = {
    "tier0_cups": Tier({"cup": 6}),
    "tier0_bowls": Tier({"bowl": 6}),
    "tier0_utensils": Tier({"fork": 3, "spoon": 3}),
    "tier1": Tier(MIXED),
    "tier2": Tier(MIXED, intersections=4, highest=3),
    "tier3": Tier({**MIXED, "plate": 2}, intersections=7, highest=4, touching=0.5),
}
"""Name of a tier -> what is on its table (section 7.1; the fourth is ours)."""


def make_table(tier: str, seed: int, sizes: DishSizes = STANDARD) -> Table:
    """Return the table of a tier and a seed. Raises UsageError for a tier that is not in `TIERS`, or that needs a kind
    which `sizes` do not have."""
    if tier not in TIERS:
        raise UsageError(f"there is no tier {tier!r}", hint=f"choose one of {', '.join(TIERS)}")
    missing = [kind for kind in TIERS[tier].counts if kind not in sizes.kinds]
    if missing:
        raise UsageError(f"{tier} has {', '.join(missing)}, of which no size is known", hint="add them to --dishes")
    random = np.random.default_rng([seed, 71, list(TIERS).index(tier)])
    while True:
        table = _draw(TIERS[tier], random, sizes)
        if table is not None:
            return table


def _draw(tier: Tier, random: np.random.Generator, sizes: DishSizes) -> Table | None:
    """Return a table, or None where the last items found no place."""
    table = Table(())
    touches_left = tier.intersections
    for kind in ORDER:
        for number in range(tier.counts.get(kind, 0)):
            for _ in range(TRIES):
                item = _anywhere(f"{kind}_{number + 1}", kind, random, sizes)
                if not footprint(item).on_table:
                    continue
                touched = [stack for stack in table.stacks if _least_gap(footprint(item), stack) < APART]
                if not touched:
                    break
                top = touched[0][-1]
                if (
                    touches_left
                    and len(touched) == 1
                    and len(touched[0]) < tier.highest
                    and radius(item) <= radius(top)
                ):
                    z = stand_height(table, item, top.name)
                    item = replace(item, position=(top.position[0], top.position[1], z), on=top.name)
                    others = [stack for stack in table.stacks if stack is not touched[0]]
                    if all(_least_gap(footprint(item), stack) >= 0.0 for stack in others):
                        touches_left -= 1
                        break
            else:
                return None
            if item.on is None and random.random() < tier.touching:
                item = _push_to_touch(item, table)
            table = Table((*table.items, item))
    return table


def _anywhere(name: str, kind: Kind, random: np.random.Generator, sizes: DishSizes) -> Item:
    x, y = random.uniform(-0.39, 0.39), random.uniform(-0.305, 0.305)
    yaw = 0.0 if sizes[kind].is_dish else random.uniform(-pi / 2, pi / 2)
    return make_item(name, kind, x, y, yaw, sizes=sizes)


def _least_gap(print_: Footprint, stack: tuple[Item, ...]) -> float:
    return min(gap(print_, footprint(item)) for item in stack)


def _push_to_touch(item: Item, table: Table) -> Item:
    """Return the item moved straight towards the nearest thing until something is touched."""
    if not table.items:
        return item
    x, y, _ = item.position
    target = min(table.items, key=lambda other: hypot(other.position[0] - x, other.position[1] - y))
    heading = atan2(target.position[1] - y, target.position[0] - x)
    for _ in range(200):
        nearest = min(_least_gap(footprint(item, x, y), stack) for stack in table.stacks)
        if nearest <= 1e-6:
            break
        x, y = x + nearest * cos(heading), y + nearest * sin(heading)
    return replace(item, position=(x, y, 0.0))

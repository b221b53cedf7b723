"""Which stacks dishes of known sizes make, and between which heights their lips then are."""

from __future__ import annotations

from functools import cache
from itertools import product

from scenewright.stages.tableware.world.items import DishSizes, Kind, rise

MOST = 4
"""Dishes in a stack."""
ORDER: tuple[Kind, ...] = ("plate", "bowl", "cup")
BELOW, BELOW_SHARE, ABOVE = 0.014, 0.36, 0.010
"""A lip is seen no lower than its dish's height less the first [m] or this share of it, whichever is less, and no
higher than the third [m] over the highest that a stack has."""


@cache
def possible_stacks(sizes: DishSizes) -> tuple[tuple[tuple[Kind, ...], tuple[float, ...], dict[Kind, float]], ...]:
    """Return every stack as (kinds, feet, highest lip by kind): wider dishes lower, at most MOST."""
    result = []
    order = [kind for kind in ORDER if kind in sizes.dishes]
    for counts in product(range(MOST + 1), repeat=len(order)):
        if not 0 < sum(counts) <= MOST:
            continue
        kinds: list[Kind] = [kind for kind, count in zip(order, counts, strict=True) for _ in range(count)]
        feet = [0.0]
        for lower, upper in zip(kinds, kinds[1:], strict=False):
            feet.append(feet[-1] + rise(sizes[upper], sizes[lower]))
        lips = {kind: foot + sizes[kind].height for kind, foot in zip(kinds, feet, strict=True)}
        result.append((tuple(kinds), tuple(feet), lips))
    return tuple(result)


@cache
def lip_range(kind: Kind, sizes: DishSizes) -> tuple[float, float]:
    """Return the heights [m] between which a lip of the kind may be seen, stacks included."""
    height = sizes[kind].height
    highest = max(lips[kind] for _, _, lips in possible_stacks(sizes) if kind in lips)
    return height - min(BELOW, BELOW_SHARE * height), highest + ABOVE

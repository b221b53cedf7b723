"""What a stack holds, from the rims that are seen: heights of lips against those that known dishes would have."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from stages.tableware.vision.rim_finding import Rim
from stages.tableware.world.items import DISHES, MEASURES, Kind, rise

MOST = 4
"""Dishes in a stack."""
CONCENTRIC = 0.016
"""Rims of one stack lie this near to each other [m]."""
LIP_TOLERANCE = 0.004
"""A lip further than this from where it must be is in doubt [m]."""
ORDER: tuple[Kind, ...] = ("plate", "bowl", "cup")


@dataclass(frozen=True)
class Stack:
    """Dishes from the lowest up with their foot heights [m], centre [m], and how far the lips are off [m]."""

    kinds: tuple[Kind, ...]
    feet: tuple[float, ...]
    x: float
    y: float
    misfit: float
    rims: tuple[Rim, ...]
    """From the lowest up: one for every kind."""

    @property
    def top(self) -> float:
        """Height of the uppermost lip [m]."""
        return self.feet[-1] + MEASURES[self.kinds[-1]].height


@cache
def _possible() -> tuple[tuple[tuple[Kind, ...], tuple[float, ...], dict[Kind, float]], ...]:
    """Return every stack as (kinds, feet, highest lip by kind): wider dishes lower, at most MOST."""
    result = []
    for counts in product(range(MOST + 1), repeat=len(ORDER)):
        if not 0 < sum(counts) <= MOST:
            continue
        kinds: list[Kind] = [kind for kind, count in zip(ORDER, counts, strict=True) for _ in range(count)]
        feet = [0.0]
        for lower, upper in zip(kinds, kinds[1:], strict=False):
            feet.append(feet[-1] + rise(MEASURES[upper], MEASURES[lower]))
        lips = {kind: foot + MEASURES[kind].height for kind, foot in zip(kinds, feet, strict=True)}
        result.append((tuple(kinds), tuple(feet), lips))
    return tuple(result)


def read_stacks(rims: list[Rim]) -> list[Stack]:
    """Return the stacks that rims belong to, widest first: each rim is the topmost of its kind there."""
    stacks: list[Stack] = []
    left = sorted(rims, key=lambda rim: (-MEASURES[rim.kind].rim_radius, -rim.support))
    while left:
        base = left.pop(0)
        members = [base]
        for kind in DISHES:
            near = [
                rim
                for rim in left
                if rim.kind == kind != base.kind and np.hypot(rim.x - base.x, rim.y - base.y) < CONCENTRIC
            ]
            if near:
                member = min(near, key=lambda rim: np.hypot(rim.x - base.x, rim.y - base.y))
                members.append(member)
                left.remove(member)
        stacks.append(_read(members))
    return stacks


def _read(members: list[Rim]) -> Stack:
    """Return the possible stack whose lips are nearest to those of the rims (root mean square)."""
    members = sorted(members, key=lambda rim: -MEASURES[rim.kind].rim_radius)
    seen = {rim.kind: rim.lip for rim in members}
    best, least = None, np.inf
    for kinds, feet, lips in _possible():
        if lips.keys() != seen.keys():
            continue
        misfit = float(np.sqrt(np.mean([(lips[kind] - seen[kind]) ** 2 for kind in seen])))
        if misfit < least:
            best, least = (kinds, feet), misfit
    assert best is not None
    weights = np.array([rim.support for rim in members])
    x = float(np.average([rim.x for rim in members], weights=weights))
    y = float(np.average([rim.y for rim in members], weights=weights))
    return Stack(best[0], best[1], x, y, least, tuple(members))

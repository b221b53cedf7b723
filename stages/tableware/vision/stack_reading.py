"""What a stack holds, from the rims that are seen: heights of lips against those that known dishes would have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.tableware.vision.possible_stacks import possible_stacks
from scenewright.stages.tableware.vision.rim_finding import Rim
from scenewright.stages.tableware.world.items import DishSizes, Kind, Measures

CONCENTRIC = 0.016
"""Rims of one stack lie this near to each other [m]."""
LIP_TOLERANCE = 0.004
"""A lip further than this from where it must be is in doubt [m]."""


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
    measures: tuple[Measures, ...]
    """Of each dish, from the lowest up."""

    @property
    def top(self) -> float:
        """Height of the uppermost lip [m]."""
        return self.feet[-1] + self.measures[-1].height


def read_stacks(rims: list[Rim], sizes: DishSizes) -> list[Stack]:
    """Return the stacks that rims belong to, widest first: each rim is the topmost of its kind there."""
    stacks: list[Stack] = []
    unread = sorted(rims, key=lambda rim: (-sizes[rim.kind].rim_radius, -rim.support))
    while unread:
        base = unread.pop(0)
        members = [base]
        for kind in sizes.dishes:
            members_of_stack = [
                rim
                for rim in unread
                if rim.kind == kind != base.kind and np.hypot(rim.x - base.x, rim.y - base.y) < CONCENTRIC
            ]
            if members_of_stack:
                member = min(members_of_stack, key=lambda rim: np.hypot(rim.x - base.x, rim.y - base.y))
                members.append(member)
                unread.remove(member)
        stacks.append(_read_stack(members, sizes))
    return stacks


def _read_stack(members: list[Rim], sizes: DishSizes) -> Stack:
    """Return the possible stack whose lips are nearest to those of the rims (root mean square)."""
    members = sorted(members, key=lambda rim: -sizes[rim.kind].rim_radius)
    seen_lips = {rim.kind: rim.lip for rim in members}
    best, least = None, np.inf
    for kinds, feet, lips in possible_stacks(sizes):
        if lips.keys() != seen_lips.keys():
            continue
        misfit = float(np.sqrt(np.mean([(lips[kind] - seen_lips[kind]) ** 2 for kind in seen_lips])))
        if misfit < least:
            best, least = (kinds, feet), misfit
    assert best is not None
    weights = np.array([rim.support for rim in members])
    x = float(np.average([rim.x for rim in members], weights=weights))
    y = float(np.average([rim.y for rim in members], weights=weights))
    return Stack(best[0], best[1], x, y, least, tuple(members), tuple(sizes[kind] for kind in best[0]))

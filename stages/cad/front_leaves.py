"""The leaves of a front, by its bars: each bar has one, and they share the front between them.

Seams are two millimetres wide and seldom seen. So the front is cut between bars, again and again, where they are
farthest apart: a drawer has its bar in its middle, doors beside each other are equally wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.cad.front_bars import Bar, Front

LEAST_LEAF, MARGIN = 0.08, 0.01
"""Least edge of a leaf, and distance of a cut from a bar [m]."""
ASIDE = 0.2
"""The bar of a door is so far from its middle, as a share of half its width."""
LEAST_PAIR, BESIDE = 0.25, (0.01, 0.12)
"""Of two doors that meet, each is so wide at least, and its bar so far from where they do [m]."""
HIGH, MIDDLE = 0.5, 0.5
"""A lying bar pulls a drawer, but where its leaf is higher than this [m] and it is farther from the middle than this
share of half its height: there it may swing a flap."""


@dataclass(frozen=True)
class FrontLeaf:
    """A part of a front that moves: a drawer's, which slides out, or a door, which swings about an upright edge."""

    low: np.ndarray
    """(2,) least corner: along the front to the right, and up [m]."""
    high: np.ndarray
    """(2,)."""
    bar: Bar
    seen: bool = True
    """Whether its bar was."""

    @property
    def slides(self) -> bool:
        """Whether it is a drawer's."""
        return not self.bar.standing

    @property
    def hinge_right(self) -> bool:
        """Whether a door hangs on its right edge, as seen from before it: the far one from its bar."""
        return bool(self.bar.middle[0] < 0.5 * (self.low[0] + self.high[0]))


def leaves_of(front: Front) -> tuple[FrontLeaf, ...] | str:
    """Return the leaves of a front, or why its bars make none."""
    if not front.bars:
        return "no bar stands out of it"
    divided = _divided(front.low, front.high, front.bars)
    if divided is None:
        return "its bars are beside and above each other"
    leaves = tuple(each for leaf in divided for each in _pair(leaf))
    for leaf in leaves:
        size, off = leaf.high - leaf.low, np.abs(leaf.bar.middle - 0.5 * (leaf.low + leaf.high))
        if size.min() < LEAST_LEAF:
            return f"a leaf would be {100 * size.min():.0f} cm wide"
        if leaf.bar.standing and off[0] < ASIDE * 0.5 * size[0]:
            return "a bar stands in the middle of a leaf"
        if leaf.slides and size[1] > HIGH and off[1] > MIDDLE * 0.5 * size[1]:
            return "a bar that lies may be of a flap"
    return leaves


def _pair(leaf: FrontLeaf) -> tuple[FrontLeaf, ...]:
    """Return the two doors that meet in the middle of a leaf, where its bar stands beside that and the other was not
    seen; else the leaf."""
    middle = 0.5 * (leaf.low + leaf.high)
    off, half = leaf.bar.middle[0] - middle[0], middle[0] - leaf.low[0]
    if not leaf.bar.standing or half < LEAST_PAIR or not BESIDE[0] < abs(off) < BESIDE[1]:
        return (leaf,)
    mirrored = (2 * middle[0] - leaf.bar.high[0], 2 * middle[0] - leaf.bar.low[0])
    low, high = (np.array([x, z]) for x, z in zip(mirrored, (leaf.bar.low[1], leaf.bar.high[1]), strict=True))
    other = replace(leaf.bar, low=low, high=high)
    left, right = (leaf.bar, other) if off < 0 else (other, leaf.bar)
    return (
        FrontLeaf(leaf.low, np.array([middle[0], leaf.high[1]]), left, seen=left is leaf.bar),
        FrontLeaf(np.array([middle[0], leaf.low[1]]), leaf.high, right, seen=right is leaf.bar),
    )


def _divided(low: np.ndarray, high: np.ndarray, bars: Sequence[Bar]) -> tuple[FrontLeaf, ...] | None:
    """Return the leaves between two corners (2,), cut where bars are farthest apart; None where no cut parts them."""
    if len(bars) == 1:
        return (FrontLeaf(low, high, bars[0]),)
    widest: tuple[float, int, list[Bar], list[Bar]] | None = None
    for axis in (0, 1):
        ordered = sorted(bars, key=lambda bar: float(bar.middle[axis]))
        for k in range(1, len(ordered)):
            first, second = ordered[:k], ordered[k:]
            gap = min(bar.low[axis] for bar in second) - max(bar.high[axis] for bar in first)
            if gap > 0 and (widest is None or gap > widest[0]):
                widest = (float(gap), axis, first, second)
    if widest is None:
        return None
    _, axis, first, second = widest
    cut_high, cut_low = high.copy(), low.copy()
    cut_high[axis] = cut_low[axis] = _cut(axis, low[axis], high[axis], first, second)
    one, other = _divided(low, cut_high, first), _divided(cut_low, high, second)
    return None if one is None or other is None else one + other


def _cut(axis: int, low: float, high: float, first: Sequence[Bar], second: Sequence[Bar]) -> float:
    """Return where a front is cut between two groups of bars [m]."""
    below = max(first, key=lambda bar: float(bar.high[axis]))
    above = min(second, key=lambda bar: float(bar.low[axis]))
    if axis == 0 and below.standing and above.standing:
        place = low + (high - low) * len(first) / (len(first) + len(second))
    elif not below.standing and not above.standing:
        place = 0.5 * (below.middle[axis] + above.middle[axis])
    elif axis == 1 and not above.standing:
        place = 2 * above.middle[1] - high
    elif axis == 1 and not below.standing:
        place = 2 * below.middle[1] - low
    else:
        place = 0.5 * (below.high[axis] + above.low[axis])
    return float(np.clip(place, below.high[axis] + MARGIN, max(above.low[axis] - MARGIN, below.high[axis] + MARGIN)))

"""Handles as a map shows them: bars that stand out of an upright front. One that lies pulls a drawer, one that stands
swings a door."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cad.carcasses import ACROSS, Patches, flat_places
from scenewright.stages.kit.geometry.point_clouds import linked

LEVELS, MOST_HEIGHT, NOISES = (0.008, 0.01, 0.014, 0.02, 0.03), 0.10, 3.0
"""Heights over a front above which bars are looked for, one after the other, and below which they end [m]; a level
below so many times the front's noise says nothing."""
FLATNESS, MOST_NOISE, MOST_SLOPE = 0.012, 0.008, 0.1
"""Surface so near to the plane of a front is of it [m]; a front has no more noise [m], nor slope against its thing."""
LEAST_FRONT, CLOSED, MOST_BEFORE = 0.04, 0.5, 0.1
"""Least surface of a front [m²]; it has this share of its rectangle at least, and before it is at most this share."""
CELL, FULL = 0.03, 0.5
"""A front ends where rows of cells of this edge [m] have less than this share of what its rows have."""
ALONG, ACROSS_BAR = 0.12, 0.03
"""Surface of one bar is no farther apart along it, and across it [m]."""
SHORTEST, LONG, WIDEST, ELONGATED = 0.05, 0.10, 0.08, 1.4
"""A bar is so long, so wide at most as the map shows it [m], and so many times as long as wide; one that is not long
counts where it is in line with one that is."""
FEWEST, LEAST = 4, 0.012
"""Patches of surface of a bar; and the bar of a front that stands out most does so by as much [m]."""
ENDS = (5, 95)
"""Between these percentiles of its surface a bar lies."""
RIM = 0.01
"""What is nearer to the end of a front may be of the next side [m]."""


@dataclass(frozen=True)
class Bar:
    """A handle. Places on a front: along it to the right as seen from before it, and up [m]."""

    low: np.ndarray
    """(2,) least corner."""
    high: np.ndarray
    """(2,)."""
    height: float
    """How far it stands out [m]."""
    standing: bool

    @property
    def middle(self) -> np.ndarray:
        """(2,)."""
        return np.asarray(0.5 * (self.low + self.high))


@dataclass(frozen=True)
class Front:
    """The flat side of a thing that looks along -y of its frame."""

    low: np.ndarray
    """(2,) least corner: x and z [m]."""
    high: np.ndarray
    """(2,)."""
    level: float
    """y of its plane in its middle [m]."""
    bars: tuple[Bar, ...]


def front_of(patches: Patches) -> Front | None:
    """Return the largest flat side that looks along -y, with its bars; None without any, or where it is too rough."""
    facing = patches.normals[:, 1] < -ACROSS
    places = flat_places(patches.points[facing, 1], patches.areas[facing])
    if not places or max(area for _, area in places) < LEAST_FRONT:
        return None
    level = max(places, key=lambda place: place[1])[0]
    design = np.column_stack([patches.points[:, [0, 2]], np.ones(len(patches.areas))])
    plane, on_plane = np.array([0.0, 0.0, level]), facing & (np.abs(patches.points[:, 1] - level) < 2 * FLATNESS)
    for _ in range(3):
        if np.count_nonzero(on_plane) < 3:
            return None
        plane = np.linalg.lstsq(design[on_plane], patches.points[on_plane, 1], rcond=None)[0]
        heights = design @ plane - patches.points[:, 1]
        on_plane = facing & (np.abs(heights) < FLATNESS)
    if not on_plane.any() or np.abs(plane[:2]).max() > MOST_SLOPE:
        return None
    noise = 1.4826 * float(np.median(np.abs(heights[on_plane])))
    if noise > MOST_NOISE:
        return None
    low, high = _closed_rectangle(patches.points[on_plane][:, [0, 2]])
    on_front = np.all((patches.points[:, [0, 2]] > low) & (patches.points[:, [0, 2]] < high), axis=1)
    seen = float(patches.areas[on_plane & on_front].sum())
    before = float(patches.areas[on_front & (heights > MOST_HEIGHT)].sum())
    if seen < CLOSED * float(np.prod(high - low)) or before > MOST_BEFORE * seen:
        return None
    here = on_front & (heights > NOISES * noise) & (heights < MOST_HEIGHT)
    bars = in_line(bars_in(patches.points[here][:, [0, 2]], heights[here]))
    bars = tuple(bar for bar in bars if np.all((bar.low > low + RIM) & (bar.high < high - RIM)))
    if max((bar.height for bar in bars), default=0.0) < LEAST:
        bars = ()
    return Front(low, high, float(np.array([*(0.5 * (low + high)), 1.0]) @ plane), bars)


def _closed_rectangle(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (2,) of the rectangle whose rows and columns places (N, 2) fill: what stands on a thing, in
    the plane of its front, is narrower."""
    for axis in (1, 0):
        cells = np.unique(np.floor(places / CELL).astype(int), axis=0)
        numbers, counts = np.unique(cells[:, axis], return_counts=True)
        full = numbers[counts >= FULL * np.percentile(counts, 75)]
        at = np.floor(places[:, axis] / CELL)
        places = places[(at >= full.min()) & (at <= full.max())]
    return places.min(axis=0), places.max(axis=0)


def bars_in(places: np.ndarray, heights: np.ndarray) -> tuple[Bar, ...]:
    """Return the bars that surface shows which stands out of a front at places (N, 2), by heights (N,) [m].

    Each level is looked at from the lowest up: what is no bar at one, as two of them are joined, may be so higher up.
    """
    bars: list[Bar] = []
    left = np.ones(len(places), dtype=bool)
    for level in LEVELS:
        high = np.flatnonzero(left & (heights > level))
        found = [entry for standing in (False, True) for entry in _at_level(places, heights, high, standing)]
        for rows, bar in sorted(found, key=lambda entry: -len(entry[0])):
            if left[rows].all():
                left[rows] = False
                bars.append(bar)
    return tuple(bars)


def in_line(bars: Sequence[Bar]) -> tuple[Bar, ...]:
    """Return the bars that are long, and of the others those that are above or beside one that is, as it lies or
    stands: the end of a bar alone does not tell which way it goes."""
    long = [bar for bar in bars if np.max(bar.high - bar.low) >= LONG]

    def beside(bar: Bar) -> bool:
        along, alike = (1 if bar.standing else 0), [each for each in long if each.standing == bar.standing]
        return any(each.low[along] < bar.middle[along] < each.high[along] for each in alike)

    return tuple(bar for bar in bars if np.max(bar.high - bar.low) >= LONG or beside(bar))


def _at_level(
    places: np.ndarray, heights: np.ndarray, high: np.ndarray, standing: bool
) -> Iterator[tuple[np.ndarray, Bar]]:
    """Yield the bars that lie, or stand, in the rows `high` of what stands out, each with its rows."""
    reach = np.array([ACROSS_BAR, ALONG] if standing else [ALONG, ACROSS_BAR])
    for group in linked(places[high] / reach, np.inf):
        rows = high[group]
        if len(rows) < FEWEST:
            continue
        first, last = np.percentile(places[rows], ENDS, axis=0)
        length, width = (last - first)[::-1] if standing else last - first
        if length >= max(SHORTEST, ELONGATED * width) and width <= WIDEST:
            yield rows, Bar(first, last, float(np.percentile(heights[rows], ENDS[1])), standing)

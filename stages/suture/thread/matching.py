"""Which point of the right eye's thread is which point of the left eye's path: dynamic programming along the curve.

In a rectified pair a point lies in the same row of both eyes. A row meets the right eye's thread in several places,
and where the thread runs along the row in a whole stretch; the right one moves steadily along the curve (Viterbi's
algorithm over the places in each row, with a state for "not seen").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.suture.rig import StereoRig
from scenewright.stages.suture.thread.skeleton import Stretch

NEAREST, FARTHEST = 0.06, 0.8
"""Depths [m] between which a thread may lie."""
ROWS = 2.0
"""Places up to so many rows away are considered."""
ROW_SIGMA = 0.7
"""Standard deviation of the rows between both eyes [px]; by eye."""
EVERY = 2
"""One in so many points of the path is matched."""
MOST_PLACES = 24
"""Most places of the right eye that are considered for one point; by eye."""
CARRIED = 8
"""Cheapest places of a point from which one goes on to the next; by eye."""
UNSEEN_COST = 2.5
"""Cost of a point that the right eye does not see; by eye."""
SLOPE, LEAST_STEP = 0.5, 0.5
"""Change of the disparity that costs nothing [px/px of path], and what is added to it [px]; by eye."""
SLOPE_IN_GAPS, GAP = 0.1, 16.0
"""The same over what a step is longer than GAP [px]; by eye."""
HIGHEST_STEP_COST = 60.0
"""Highest cost of a change of the disparity; by eye."""
LARGEST_LEAN = 2.0
"""Rows that do not quite agree are made up for along the right eye's line where it leans less than so many columns a
row."""


@dataclass(frozen=True)
class Places:
    """The right eye's thread: places (N, 2) [px] with unit directions (N, 2), sorted by row."""

    points: np.ndarray
    directions: np.ndarray


def places_of(stretches: Sequence[Stretch]) -> Places:
    """Return the places on all stretches."""
    points, directions = [np.empty((0, 2))], [np.empty((0, 2))]
    for stretch in stretches:
        if len(stretch.points) >= 3:
            points.append(stretch.points)
            directions.append(directions_of(stretch.points))
    every, tangents = np.concatenate(points), np.concatenate(directions)
    order = np.argsort(every[:, 1], kind="stable")
    return Places(every[order], tangents[order])


def directions_of(points: np.ndarray, reach: int = 3) -> np.ndarray:
    """Return the unit directions (N, 2) of a line (N, 2), over `reach` points on either side."""
    index = np.arange(len(points))
    step = points[np.minimum(index + reach, len(points) - 1)] - points[np.maximum(index - reach, 0)]
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9))


def matched(
    path: np.ndarray, seen: np.ndarray, places: Places, rig: StereoRig, start_disparity: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the indices (M,) of the path's matched points, their disparities (M,) [px] and the right line's |sine| to
    the rows there (M,).

    `path` (N, 2) [px], `seen` (N,); `start_disparity`, where it is known, is the disparity at the path's beginning.
    """
    at = np.flatnonzero(seen)[::EVERY]
    if len(at) == 0 or len(places.points) == 0:
        return np.empty(0, dtype=int), np.empty(0), np.empty(0)
    least, most = rig.focal * rig.baseline / FARTHEST, rig.focal * rig.baseline / NEAREST
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    low = np.searchsorted(places.points[:, 1], path[at, 1] - ROWS)
    high = np.searchsorted(places.points[:, 1], path[at, 1] + ROWS)
    disparities: list[np.ndarray] = []
    back: list[np.ndarray] = []
    chosen: list[np.ndarray] = []
    before = np.array([np.nan if start_disparity is None else start_disparity])
    costs = np.zeros(1)
    last = 0.0
    for index, first, end in zip(at, low, high, strict=True):
        disparity, emission, number = _candidates(path[index], places, int(first), int(end), least, most)
        step = along[index] - last
        last = along[index]
        allowed = LEAST_STEP + SLOPE * min(step, GAP) + SLOPE_IN_GAPS * max(step - GAP, 0.0)
        change = np.abs(disparity[:, None] - before[None]) / allowed
        moving = np.minimum(np.where(np.isnan(change), 0.0, change) ** 2, HIGHEST_STEP_COST)
        total = moving + costs[None]
        whence = np.argmin(total, axis=1) if len(disparity) else np.empty(0, dtype=int)
        arrived = total[np.arange(len(disparity)), whence] + emission
        # not seen here: the disparity is carried on, for the cheapest ways only
        carried = np.argsort(costs, kind="stable")[:CARRIED]
        disparities.append(np.concatenate([disparity, before[carried]]))
        back.append(np.concatenate([whence, carried]))
        chosen.append(np.concatenate([number, np.full(len(carried), -1)]))
        before = disparities[-1]
        costs = np.concatenate([arrived, costs[carried] + UNSEEN_COST])
        costs = costs - costs.min()
    state = int(np.argmin(costs))
    matches = []
    for index in range(len(at) - 1, -1, -1):
        if chosen[index][state] >= 0:
            matches.append((int(at[index]), float(disparities[index][state]), int(chosen[index][state])))
        state = int(back[index][state])
    matches.reverse()
    if not matches:
        return np.empty(0, dtype=int), np.empty(0), np.empty(0)
    indices, values, numbers = (np.array(column) for column in zip(*matches, strict=True))
    return indices, values, np.abs(places.directions[numbers, 1])


def _candidates(
    point: np.ndarray, places: Places, first: int, end: int, least: float, most: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return disparities (K,), costs (K,) and numbers (K,) of the places where the row of `point` meets the thread."""
    rows = point[1] - places.points[first:end, 1]
    tangents = places.directions[first:end]
    lean = tangents[:, 0] * np.sign(tangents[:, 1]) / np.maximum(np.abs(tangents[:, 1]), 1e-3)
    shift = np.where(np.abs(lean) < LARGEST_LEAN, rows * lean, 0.0)
    disparity = point[0] - (places.points[first:end, 0] + shift)
    cost = (rows / ROW_SIGMA) ** 2
    possible = np.flatnonzero((disparity >= least) & (disparity <= most))
    if len(possible) > MOST_PLACES:
        possible = possible[
            np.argsort(cost[possible], kind="stable")[:: max(len(possible) // (2 * MOST_PLACES), 1)][:MOST_PLACES]
        ]
    return disparity[possible], cost[possible], possible + first

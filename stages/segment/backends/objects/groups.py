"""Groups of patches while they are joined: what each looks like, and what every pair of neighbours does together."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.hulls import convex_hull, hull_content
from scenewright.stages.segment.backends.objects.pairs import (
    CONTENT_STEP,
    COUNT,
    HIDING_MARGIN,
    inverse_plane,
    pair_features,
)
from scenewright.stages.segment.backends.objects.regions import Regions

LARGEST_GAP = 3.0
"""Groups that do not touch are a pair when their hulls' corners are closer than this times the root of the pixels of
the smaller one."""
SMALLEST_APART = 250.0
"""Least pixels of both groups of a pair that does not touch."""


class Groups:
    """Every patch is a group at first. A group goes by the number of one of its patches; row 0 is unused.

    `group_of` (N + 1,) group of every patch; `sums` (N + 1, POINT_SUMS) of every group, the first of them its pixels.
    """

    def __init__(self, regions: Regions, labels: np.ndarray, inverse: np.ndarray) -> None:
        """`regions` are used up; `labels` (H, W) int32 patches; `inverse` (H, W) [1/m]."""
        count = len(regions.sums) - 1
        self.group_of = np.arange(count + 1)
        self.sums = regions.sums
        self._colors, self._heights = regions.colors, regions.heights
        self._perimeters, self._borders = regions.perimeters, regions.borders
        self._image, self._inverse = labels.copy(), inverse
        self._alive = np.arange(count + 1) > 0
        lengths = np.diff(regions.corner_starts)
        self._hulls = np.zeros((count + 1, int(lengths.max(initial=1)), 2))
        self._corners = np.zeros(count + 1, dtype=np.int64)
        self._boxes = np.zeros((count + 1, 4))
        self._own_behind = np.zeros(count + 1)
        for k in range(1, count + 1):
            self._set_hull(k, regions.corners[regions.corner_starts[k] : regions.corner_starts[k + 1]])
        self._fresh = -1

    def fresh_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return pairs (P, 2) of groups that may be one object, ascending, and their features (P, COUNT) float32: all
        pairs at first, afterwards those of the group that was joined last."""
        pairs = _candidates(self._fresh, self._alive, self.sums, self._borders, self._boxes)
        features = _features(
            pairs,
            self.sums,
            self._colors,
            self._heights,
            self._perimeters,
            self._borders,
            self._hulls,
            self._corners,
            self._own_behind,
            self._image,
            self._inverse,
        )
        return pairs, features

    def join(self, first: int, second: int) -> None:
        """Make `second` a part of `first`."""
        self._alive[second] = False
        self.group_of[self.group_of == second] = first
        shared = self._borders[first, second, 0]
        for values in (self.sums, self._colors, self._heights):
            values[first] += values[second]
        self._perimeters[first] += self._perimeters[second] - 2 * shared
        others = self._alive.copy()
        others[first] = False
        self._borders[first, others] += self._borders[second, others]
        self._borders[others, first] += self._borders[others, second]
        left, top, right, bottom = (int(side) for side in self._boxes[second])
        window = self._image[max(0, top) : bottom + 1, max(0, left) : right + 1]
        window[window == second] = first
        self._set_hull(first, convex_hull(np.concatenate([self._hull(first), self._hull(second)])))
        self._fresh = first

    def _hull(self, k: int) -> np.ndarray:
        return np.asarray(self._hulls[k, : self._corners[k]])

    def _set_hull(self, k: int, hull: np.ndarray) -> None:
        if len(hull) > self._hulls.shape[1]:
            self._hulls = np.pad(self._hulls, ((0, 0), (0, len(hull)), (0, 0)))
        self._hulls[k, : len(hull)] = hull
        self._corners[k] = len(hull)
        self._boxes[k] = (*hull.min(axis=0), *hull.max(axis=0))
        self._own_behind[k] = _own_behind(np.ascontiguousarray(hull), k, self.sums, self._image, self._inverse)


@compiled
def _candidate(a: int, b: int, sums: np.ndarray, borders: np.ndarray, boxes: np.ndarray) -> bool:
    if borders[a, b, 0] > 0:
        return True
    smaller = min(sums[a, 0], sums[b, 0])
    if smaller < SMALLEST_APART:
        return False
    across = max(0.0, max(boxes[a, 0], boxes[b, 0]) - min(boxes[a, 2], boxes[b, 2]))
    down = max(0.0, max(boxes[a, 1], boxes[b, 1]) - min(boxes[a, 3], boxes[b, 3]))
    return np.hypot(across, down) < LARGEST_GAP * np.sqrt(smaller)


@compiled
def _own_behind(hull: np.ndarray, k: int, sums: np.ndarray, groups: np.ndarray, inverse: np.ndarray) -> float:
    plane, residual = inverse_plane(sums[k])
    covered, hidden, missing, behind = hull_content(
        hull, groups, inverse, k, k, plane, HIDING_MARGIN + 2 * residual, CONTENT_STEP
    )
    return behind / max(1.0, covered + hidden + missing + behind)


@compiled
def _candidates(fresh: int, alive: np.ndarray, sums: np.ndarray, borders: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """The pairs (P, 2) that may be one, with the group `fresh` in them (-1: all)."""
    count = len(alive)
    pairs = np.empty((count * count if fresh == -1 else count, 2), dtype=np.int64)
    size = 0
    for a in range(1, count):
        if not alive[a]:
            continue
        for b in range(a + 1, count):
            if alive[b] and (fresh == -1 or fresh in (a, b)) and _candidate(a, b, sums, borders, boxes):
                pairs[size, 0], pairs[size, 1] = a, b
                size += 1
    return pairs[:size].copy()


@compiled
def _features(
    pairs: np.ndarray,
    sums: np.ndarray,
    colors: np.ndarray,
    heights: np.ndarray,
    perimeters: np.ndarray,
    borders: np.ndarray,
    hulls: np.ndarray,
    corners: np.ndarray,
    own_behind: np.ndarray,
    image: np.ndarray,
    inverse: np.ndarray,
) -> np.ndarray:
    result = np.empty((len(pairs), COUNT), dtype=np.float32)
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        result[k] = pair_features(
            a,
            b,
            sums,
            colors,
            heights,
            perimeters,
            borders[a, b],
            hulls[a, : corners[a]],
            hulls[b, : corners[b]],
            own_behind,
            image,
            inverse,
        )
    return result

"""Euclidean clusters of point clouds: which of several clouds hang together."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scipy.spatial import cKDTree

MOST_PAIRS = 200_000
"""Up to so many pairs of points it is faster to look at all of them than to build a tree."""


def clouds_touch(first: np.ndarray, second: np.ndarray, distance: float) -> bool:
    """Whether any point of `first` (N, 3) comes within `distance` [m] of any point of `second` (M, 3)."""
    first, second = _in_reach(np.ascontiguousarray(first), np.ascontiguousarray(second), distance)
    if not len(first) or not len(second):
        return False
    beyond = np.nextafter(distance, np.inf)
    if len(first) * len(second) <= MOST_PAIRS:
        return _any_within(first, second, beyond * beyond)
    if len(first) < len(second):
        first, second = second, first
    nearest, _ = cKDTree(first).query(second, distance_upper_bound=beyond)
    return bool(np.isfinite(nearest).any())


@compiled
def _in_reach(first: np.ndarray, second: np.ndarray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return those points of (N, 3) and (M, 3), as float64, that are within `distance` of the other's bounds: only
    they can be neighbours."""
    reach = first.dtype.type(distance)
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    for cloud in (first, second):
        for axis in range(3):
            least, most = np.inf, -np.inf
            for k in range(len(cloud)):
                least, most = min(least, cloud[k, axis]), max(most, cloud[k, axis])
            low[axis] = max(low[axis], least - reach)
            high[axis] = min(high[axis], most + reach)
    return _within(first, low, high), _within(second, low, high)


@compiled
def _within(cloud: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the points of a cloud (N, 3) between two corners (3,), as float64."""
    kept = np.empty((len(cloud), 3))
    count = 0
    for k in range(len(cloud)):
        x, y, z = cloud[k]
        if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]:
            kept[count, 0], kept[count, 1], kept[count, 2] = x, y, z
            count += 1
    return kept[:count]


@compiled
def _any_within(first: np.ndarray, second: np.ndarray, limit: float) -> bool:
    """Whether any two points of (N, 3) and (M, 3) are closer than the root of `limit`."""
    for i in range(len(first)):
        x, y, z = first[i]
        for j in range(len(second)):
            if (second[j, 0] - x) ** 2 + (second[j, 1] - y) ** 2 + (second[j, 2] - z) ** 2 < limit:
                return True
    return False


def bounds_in_reach(clouds: list[np.ndarray], distance: float) -> np.ndarray:
    """Return (N, N) whether the bounds of clouds (N_i, 3) come within `distance` [m]; empty clouds reach nothing.

    Most pairs fail here, without a look at their points.
    """
    low = np.array([cloud.min(axis=0) if len(cloud) else (np.inf,) * 3 for cloud in clouds]).reshape(-1, 3)
    high = np.array([cloud.max(axis=0) if len(cloud) else (-np.inf,) * 3 for cloud in clouds]).reshape(-1, 3)
    reached = low[:, None] - distance <= high[None, :]
    return np.all(reached & reached.transpose(1, 0, 2), axis=2)


def largest_cluster(clouds: list[np.ndarray], sizes: list[int], *, distance: float) -> set[int]:
    """Return the indices of the clouds (N_i, 3) [m] in the cluster with the largest sum of `sizes`.

    Clouds within `distance` of each other belong together, and so do chains of them. Of equal clusters the one with
    the smallest index wins.
    """
    possible = bounds_in_reach(clouds, distance)
    unvisited = set(range(len(clouds)))
    best: set[int] = set()
    best_size = -1
    for seed in range(len(clouds)):
        if seed not in unvisited:
            continue
        unvisited.discard(seed)
        cluster, front = {seed}, [seed]
        while front:
            current = front.pop()
            reached = [
                neighbour
                for neighbour in sorted(unvisited)
                if possible[current, neighbour] and clouds_touch(clouds[current], clouds[neighbour], distance)
            ]
            cluster.update(reached)
            front.extend(reached)
            unvisited.difference_update(reached)
        size = sum(sizes[index] for index in cluster)
        if size > best_size:
            best, best_size = cluster, size
    return best

"""RRT-Connect (Kuffner & LaValle 2000) with shortcut smoothing; budgets are counted in samples, never in seconds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stages.kit.motion.collision import Collision
from stages.kit.motion.failures import end_in_collision, joint_limit, no_path

FINER = 3
"""A path is accepted when it is free at this many times the resolution of the search."""
LIMIT_TOLERANCE = 1e-6
"""An end may be this far outside the bounds: inverse kinematics rounds."""
Check = Callable[[np.ndarray], Collision | None]


@dataclass(frozen=True)
class SearchSpace:
    """Bounds of the joints that move, and how finely motions are checked."""

    lower: np.ndarray
    """(D,)"""
    upper: np.ndarray
    resolution: np.ndarray
    """(D,) largest change of each joint between two checks."""

    def outside(self, point: np.ndarray) -> np.ndarray:
        """Return by how much each value of a point (D,) is outside its bounds, negative inside."""
        return np.maximum(self.lower - point, point - self.upper)

    def holds(self, point: np.ndarray) -> bool:
        """Whether a point (D,) is within the bounds, to LIMIT_TOLERANCE."""
        return bool(self.outside(point).max() <= LIMIT_TOLERANCE)


def interpolate(start: np.ndarray, end: np.ndarray, resolution: np.ndarray) -> np.ndarray:
    """Return (K, D) points from `start` (excluded) to `end` (included), no joint moving more than its resolution."""
    count = max(1, int(np.ceil(np.max(np.abs(end - start) / resolution))))
    return start + (end - start) * (np.arange(1, count + 1) / count)[:, None]


def densify(path: np.ndarray, resolution: np.ndarray) -> np.ndarray:
    """Return (K, D) points along a path (N, D), no joint moving more than its resolution between two."""
    rows = [path[:1]]
    rows += [interpolate(path[i], path[i + 1], resolution) for i in range(len(path) - 1)]
    return np.concatenate(rows)


def first_collision(points: np.ndarray, check: Check) -> tuple[int, Collision] | None:
    """Return the index and collision of the first point (K, D) that is not free, None when all are."""
    for index, point in enumerate(points):
        collision = check(point)
        if collision is not None:
            return index, collision
    return None


class _Tree:
    def __init__(self, root: np.ndarray, scale: np.ndarray, capacity: int) -> None:
        self.points = np.empty((capacity, len(root)))
        self.points[0] = root
        self.parents = [-1]
        self.scale = scale

    def nearest(self, point: np.ndarray) -> int:
        difference = (self.points[: len(self.parents)] - point) / self.scale
        return int(np.argmin(np.einsum("ij,ij->i", difference, difference)))

    def add(self, point: np.ndarray, parent: int) -> int:
        if len(self.parents) == len(self.points):
            self.points = np.concatenate([self.points, np.empty_like(self.points)])
        self.points[len(self.parents)] = point
        self.parents.append(parent)
        return len(self.parents) - 1

    def branch(self, index: int) -> list[np.ndarray]:
        rows = []
        while index >= 0:
            rows.append(self.points[index].copy())
            index = self.parents[index]
        return rows


def rrt_connect(
    start: np.ndarray,
    goal: np.ndarray,
    check: Check,
    space: SearchSpace,
    random: np.random.Generator,
    *,
    samples: int = 2000,
    step: float = 8.0,
    smoothing: int = 60,
) -> np.ndarray:
    """Return a path (N, D) of straight pieces from `start` to `goal` (D,) that `check` finds free.

    `step` is the longest extension, in resolutions. Raises MotionFailed: `joint_limit`, `start_in_collision`,
    `goal_in_collision` (with the pair and its depth), `no_path` (with the samples used and the body that blocked most).
    """
    for name, point in (("start", start), ("goal", goal)):
        if not space.holds(point):
            raise joint_limit(name, point, space.outside(point))
        collision = check(point)
        if collision is not None:
            raise end_in_collision(name, collision.part, collision.other, collision.depth)
    blockers: Counter[str] = Counter()
    used = 0
    while used < samples:
        path, spent = _grow(start, goal, check, space, random, samples - used, step, blockers)
        used += spent
        if path is None:
            break
        path = shortcut(path, check, space, random, smoothing) if len(path) > 2 else path
        # What lies between two checks was not looked at: look closer, and start again when it is not free.
        found = first_collision(densify(path, space.resolution / FINER), check)
        if found is None:
            return path
        blockers[found[1].other] += 1
        used += 1
    raise no_path(samples, blockers)


def _grow(
    start: np.ndarray,
    goal: np.ndarray,
    check: Check,
    space: SearchSpace,
    random: np.random.Generator,
    samples: int,
    step: float,
    blockers: Counter[str],
) -> tuple[np.ndarray | None, int]:
    """Grow two trees until they meet; return the path (N, D) or None, and the samples used."""

    def advance(tree: _Tree, near: int, target: np.ndarray, once: bool) -> tuple[int, bool]:
        """Extend from a node towards the target; return the last node and whether the target was reached."""
        points = interpolate(tree.points[near], target, space.resolution)
        if once:
            points = points[: int(step)]
        last = near
        for number, point in enumerate(points, start=1):
            collision = check(point)
            if collision is not None:
                blockers[collision.other] += 1
                if (number - 1) % int(step) and number > 1:
                    last = tree.add(points[number - 2], last)
                return last, False
            if number % int(step) == 0 or number == len(points):
                last = tree.add(point, last)
        return last, bool(np.array_equal(tree.points[last], target))

    trees = (_Tree(start, space.resolution, 256), _Tree(goal, space.resolution, 256))
    if not blockers and advance(trees[0], 0, goal, once=False)[1]:
        return np.array([start, goal]), 0
    active = 0
    for used in range(1, samples + 1):
        grow, other = trees[active], trees[1 - active]
        sample = random.uniform(space.lower, space.upper)
        before = grow.nearest(sample)
        node, _ = advance(grow, before, sample, once=True)
        if node != before:
            target = grow.points[node].copy()
            end, reached = advance(other, other.nearest(target), target, once=False)
            if reached:
                first, second = (node, end) if active == 0 else (end, node)
                return np.array([*reversed(trees[0].branch(first)), *trees[1].branch(second)[1:]]), used
        active = 1 - active
    return None, samples


def shortcut(
    path: np.ndarray, check: Check, space: SearchSpace, random: np.random.Generator, attempts: int
) -> np.ndarray:
    """Return a shorter path (M, D): random pairs of points on it are joined by straight pieces where those are free."""
    path = without_repeats(path)
    for _ in range(attempts):
        if len(path) < 3:
            break
        lengths = np.max(np.abs(np.diff(path, axis=0)) / space.resolution, axis=1)
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        low, high = np.sort(random.uniform(0, ends[-1], size=2))
        i = min(int(np.searchsorted(ends, low, side="right")) - 1, len(path) - 2)
        j = min(int(np.searchsorted(ends, high, side="right")) - 1, len(path) - 2)
        if i == j:
            continue
        first = path[i] + (path[i + 1] - path[i]) * (low - ends[i]) / lengths[i]
        second = path[j] + (path[j + 1] - path[j]) * (high - ends[j]) / lengths[j]
        if first_collision(interpolate(first, second, space.resolution / 2), check) is None:
            path = without_repeats(np.concatenate([path[: i + 1], [first, second], path[j + 1 :]]))
    return path


def without_repeats(path: np.ndarray) -> np.ndarray:
    """Return the path (M, D) without points equal to the one before."""
    keep = np.concatenate([[True], np.any(np.abs(np.diff(path, axis=0)) > 1e-12, axis=1)])
    return path[keep]

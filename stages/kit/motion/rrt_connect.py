"""RRT-Connect (Kuffner & LaValle 2000) of OMPL, asking a check in Python, with shortcut smoothing of our own.

Budgets are counted in samples, never in seconds. OMPL draws its random numbers itself: its generator is seeded from
ours before each search, and a search builds all of its objects anew, so that the same seed gives the same path whatever
was searched before in the process.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from scenewright.schemas.errors import MissingDependency
from scenewright.stages.kit.motion.collision import Collision
from scenewright.stages.kit.motion.failures import end_in_collision, joint_limit, no_path

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
    `goal_in_collision` (with the pair and its depth), `no_path` (with the samples used and the body that blocked most);
    MissingDependency without OMPL.
    """
    for name, point in (("start", start), ("goal", goal)):
        if not space.holds(point):
            raise joint_limit(name, point, space.outside(point))
        collision = check(point)
        if collision is not None:
            raise end_in_collision(name, collision.part, collision.other, collision.depth)
    blockers: Counter[str] = Counter()

    def counted(point: np.ndarray) -> Collision | None:
        collision = check(point)
        if collision is not None:
            blockers[collision.other] += 1
        return collision

    straight = first_collision(interpolate(start, goal, space.resolution), counted) is None
    path: np.ndarray | None = np.array([start, goal]) if straight else None
    used = 0
    while used < samples:
        if path is None:
            path, spent = _search(start, goal, counted, space, random, samples - used, step)
            used += spent
        if path is None:
            break
        path = shortcut(path, check, space, random, smoothing) if len(path) > 2 else path
        # What lies between two checks was not looked at: look closer, and start again when it is not free.
        if first_collision(densify(path, space.resolution / FINER), counted) is None:
            return path
        path = None
        used += 1
    raise no_path(samples, blockers)


@lru_cache(maxsize=1)
def _ompl() -> tuple[ModuleType, ModuleType, ModuleType, type]:
    """Return OMPL's base, geometric and util modules, and a validator of motions that asks `is_free`."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise MissingDependency("the package ompl is not installed", hint="run `make setup`") from None

    class Straight(base.MotionValidator):  # type: ignore[misc]
        """Asks `is_free` whether the straight way between two states is free."""

        is_free: Any = None

        def checkMotion(self, begin: Any, end: Any, last: Any = None) -> bool:  # noqa: N802 (OMPL's name)
            return bool(self.is_free(begin, end))

    util.setLogLevel(util.LogLevel.LOG_NONE)
    return base, geometric, util, Straight


def _search(
    start: np.ndarray,
    goal: np.ndarray,
    check: Check,
    space: SearchSpace,
    random: np.random.Generator,
    samples: int,
    step: float,
) -> tuple[np.ndarray | None, int]:
    """Grow two trees until they meet; return the path (N, D) or None, and the samples used."""
    base, geometric, util, straight = _ompl()
    util.RNG.setSeed(int(random.integers(1, 2**31)))
    dimension, scale = len(start), space.resolution
    joints = base.RealVectorStateSpace(dimension)  # in resolutions, so that lengths of metres and radians compare
    bounds = base.RealVectorBounds(dimension)
    for joint in range(dimension):
        bounds.setLow(joint, float(space.lower[joint] / scale[joint]))
        bounds.setHigh(joint, float(space.upper[joint] / scale[joint]))
    joints.setBounds(bounds)
    setup = geometric.SimpleSetup(joints)
    information = setup.getSpaceInformation()

    def values(state: Any) -> np.ndarray:
        return np.array([state[joint] for joint in range(dimension)]) * scale

    def state_of(point: np.ndarray) -> Any:
        state = joints.allocState()
        for joint, value in enumerate(np.clip(point, space.lower, space.upper) / scale):
            state[joint] = float(value)
        return state

    validator = straight(information)
    validator.is_free = lambda begin, end: (
        first_collision(interpolate(values(begin), values(end), scale), check) is None
    )
    setup.setStateValidityChecker(lambda state: check(values(state)) is None)
    information.setMotionValidator(validator)
    setup.setStartAndGoalStates(state_of(start), state_of(goal))
    planner = geometric.RRTConnect(information)
    planner.setRange(step)
    setup.setPlanner(planner)
    samples_taken = 0

    def spent() -> bool:  # OMPL asks before each sample
        nonlocal samples_taken
        samples_taken += 1
        return samples_taken > samples

    setup.solve(base.PlannerTerminationCondition(spent))
    if not setup.haveExactSolutionPath():
        return None, samples
    path = np.array([values(state) for state in setup.getSolutionPath().getStates()])
    path[0], path[-1] = start, goal
    return without_repeats(path), samples_taken


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

"""Planners of the motion benchmark: same queries, same resolution of checks, same mesh checker at the end.

`algorithm on checker`, so that the two are told apart: ours and OMPL's RRT-Connect, each on our compiled check; OMPL's
on pybullet's meshes. OMPL is told the resolution at which paths are judged (FINE), in the norm in which they are (the
largest change of a joint; its own validator's Euclidean steps would be shorter still), gets its own simplification,
and the range that was quickest on the tuning seeds.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.compiled_rrt import way_is_free
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.path_query import (
    Effort,
    Query,
    compiled_free,
    confirm,
    moving_arrays,
    refusal_counts,
)
from scenewright.stages.kit.motion.path_search import find_path, leave_narrow
from scenewright.stages.kit.motion.rrt_connect import FINER, SearchSpace, interpolate, rrt_connect, without_repeats

from benchmarks.experiments.planning_motion.queries import CHAIN, MotionQuery

RESOLUTION = 0.05
"""Largest step of a joint between two checks of our search [rad]."""
FINE = RESOLUTION / FINER
"""The same of a path that counts: OMPL's search is told this one."""
RANGE = 0.8
"""Longest motion that OMPL's trees grow by [rad]; the quickest of 0.4, 0.8, 1.6 and OMPL's default on tuning seeds."""
ATTEMPTS = 240
"""At a shortcut, as many as `plan` makes. By OMPL's partialShortcutPath, which was both quicker and shorter on the
tuning seeds than its simplifyMax, ropeShortcutPath and defaults."""
SPACE = SearchSpace(CHAIN.lower, CHAIN.upper, np.full(7, RESOLUTION))
SAMPLES = 20000
"""Of ours; the mesh fallback gets the 2000 that it is used with."""
FALLBACK_SAMPLES, FALLBACK_SMOOTHING = 2000, 60
OMPL_SECONDS = 20.0
"""Of CPU time, after which OMPL gives up."""
Arm = Callable[[CollisionChecker, MotionQuery, int, bool], np.ndarray | None]
"""Checker, query, seed, and whether the path is simplified."""
IsFree = Callable[[np.ndarray], bool]
WayIsFree = Callable[[np.ndarray, np.ndarray], bool]


def _query(query: MotionQuery) -> Query:
    body = np.concatenate([query.base, query.start])
    return Query(body, np.arange(3, 10), query.start, query.goal[None], SPACE)


def ours(checker: CollisionChecker, query: MotionQuery, seed: int, simplified: bool) -> np.ndarray | None:
    """Compiled RRT-Connect, compiled shortcuts, confirmation by the meshes."""
    random, attempts = np.random.default_rng(seed), ATTEMPTS if simplified else 0
    try:
        return find_path(_query(query), checker, random, samples=SAMPLES, smoothing=attempts)
    except MotionFailed:
        return None


def mesh_fallback(checker: CollisionChecker, query: MotionQuery, seed: int, simplified: bool) -> np.ndarray | None:
    """What searches where the compiled check refuses too much: OMPL's RRT-Connect with the meshes' checks at the coarse
    resolution and our shortcuts, repeated where the closer look at the path finds a hit."""
    try:
        return rrt_connect(
            query.start,
            query.goal,
            lambda arm: checker.check_meshes(np.concatenate([query.base, arm])),
            SPACE,
            np.random.default_rng(seed),
            samples=FALLBACK_SAMPLES,
            smoothing=FALLBACK_SMOOTHING if simplified else 0,
        )
    except MotionFailed:
        return None


def ompl_pybullet(checker: CollisionChecker, query: MotionQuery, seed: int, simplified: bool) -> np.ndarray | None:
    """OMPL's RRT-Connect with pybullet's checks."""

    def free(arm: np.ndarray) -> bool:
        return checker.check_meshes(np.concatenate([query.base, arm])) is None

    def way_free(begin: np.ndarray, end: np.ndarray) -> bool:
        points = interpolate(begin, end, np.full(7, FINE))
        return all(free(points[row]) for row in bisecting(len(points)))

    return ompl_rrt_connect(query.start, query.goal, free, way_free, seed, simplified)


def ompl_compiled(checker: CollisionChecker, query: MotionQuery, seed: int, simplified: bool) -> np.ndarray | None:
    """OMPL's RRT-Connect with our compiled checks, one call for a whole motion; ends too narrow for those are left as
    ours leaves them, and the path is confirmed by the meshes as ours is."""
    asked, random, effort = _query(query), np.random.default_rng(seed), Effort()
    ways = [leave_narrow(asked, end, checker, random, effort) for end in (query.start, query.goal)]
    if ways[0] is None or ways[1] is None:
        return None
    motion = moving_arrays(asked, np.full(7, FINE), checker, refusal_counts(checker))
    path = ompl_rrt_connect(
        ways[0][-1],
        ways[1][-1],
        lambda arm: compiled_free(asked, arm, checker),
        lambda begin, end: bool(way_is_free(motion, begin, end)),
        seed,
        simplified,
    )
    if path is None:
        return None
    path = without_repeats(np.concatenate([ways[0][:-1], path, ways[1][-2::-1]]))
    return path if confirm(asked, path, checker, effort) is None else None


def bisecting(count: int) -> list[int]:
    """Return the rows 0 .. count - 1 from coarse to fine: the last, the middle, the quarters and so on."""
    order, stride = [count - 1], 1
    while stride < count:
        stride *= 2
    while stride >= 1:
        order += [row - 1 for row in range(stride, count, 2 * stride)]
        stride //= 2
    return order


def ompl_rrt_connect(
    start: np.ndarray, goal: np.ndarray, is_free: IsFree, way_is_free: WayIsFree, seed: int, simplified: bool
) -> np.ndarray | None:
    """Return OMPL's path (N, 7) from `start` to `goal` (7,), None when it finds none."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(seed + 1)
    space = ob.RealVectorStateSpace(7)
    bounds = ob.RealVectorBounds(7)
    for joint in range(7):  # a little wider, as goals at a limit are rounded to outside of it
        bounds.setLow(joint, float(CHAIN.lower[joint]) - 1e-6)
        bounds.setHigh(joint, float(CHAIN.upper[joint]) + 1e-6)
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: is_free(_values(state)))
    validator = _Straight(information)
    validator.way_is_free = way_is_free
    information.setMotionValidator(validator)
    states = []
    for values in (start, goal):
        state = space.allocState()
        for joint in range(7):
            state[joint] = float(values[joint])
        states.append(state)
    if not all(information.isValid(state) for state in states):
        return None  # OMPL would wait for another goal
    setup.setStartAndGoalStates(*states)
    planner = og.RRTConnect(information)
    planner.setRange(RANGE)
    setup.setPlanner(planner)
    end = time.process_time() + OMPL_SECONDS
    setup.solve(ob.PlannerTerminationCondition(lambda: time.process_time() > end))
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    if simplified and path.getStateCount() > 2:
        og.PathSimplifier(information).partialShortcutPath(path, ATTEMPTS, ATTEMPTS, 1.0)
    return np.array([_values(state) for state in path.getStates()])


def _values(state: ob.State) -> np.ndarray:
    return np.array([state[joint] for joint in range(7)])


class _Straight(ob.MotionValidator):  # type: ignore[misc]
    """Asks `way_is_free` whether the straight way between two states is free."""

    way_is_free: WayIsFree

    def checkMotion(self, begin: ob.State, end: ob.State, last: object = None) -> bool:  # noqa: N802 (OMPL's name)
        return self.way_is_free(_values(begin), _values(end))


ARMS: dict[str, Arm] = {
    "ours": ours,
    "ompl_compiled": ompl_compiled,
    "ompl_pybullet": ompl_pybullet,
    "mesh_fallback": mesh_fallback,
}

"""Planners of the motion benchmark: same queries, same limits, same mesh checker at the end."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from benchmarks.experiments.planning_motion.queries import CHAIN, MotionQuery
from stages.kit.motion.collision import CollisionChecker
from stages.kit.motion.failures import MotionFailed
from stages.kit.motion.path_query import Query
from stages.kit.motion.path_search import find_path
from stages.kit.motion.rrt_connect import SearchSpace, rrt_connect

RESOLUTION = 0.05
"""Largest step of a joint between two checks [rad]."""
OMPL_RESOLUTION = 0.05
"""OMPL's steps are Euclidean, so that no joint moves by more than this."""
SPACE = SearchSpace(CHAIN.lower, CHAIN.upper, np.full(7, RESOLUTION))
SMOOTHING = 60
"""Attempts at a shortcut, for every planner."""
SAMPLES = 20000
"""Of ours; the mesh fallback gets the 2000 that it is used with."""
FALLBACK_SAMPLES = 2000
OMPL_SECONDS = 20.0
"""Of CPU time, after which OMPL gives up."""
Arm = Callable[[CollisionChecker, MotionQuery, int], np.ndarray | None]


def _query(query: MotionQuery) -> Query:
    body = np.concatenate([query.base, query.start])
    return Query(body, np.arange(3, 10), query.start, query.goal[None], SPACE)


def ours(checker: CollisionChecker, query: MotionQuery, seed: int) -> np.ndarray | None:
    """Compiled RRT-Connect, compiled shortcuts, confirmation by the meshes."""
    try:
        return find_path(_query(query), checker, np.random.default_rng(seed), samples=SAMPLES, smoothing=SMOOTHING)
    except MotionFailed:
        return None


def mesh_fallback(checker: CollisionChecker, query: MotionQuery, seed: int) -> np.ndarray | None:
    """What searches where the compiled check refuses too much: OMPL's RRT-Connect with the meshes' checks, repeated
    where the closer look at the path finds a hit."""
    try:
        return rrt_connect(
            query.start,
            query.goal,
            lambda arm: checker.check_meshes(np.concatenate([query.base, arm])),
            SPACE,
            np.random.default_rng(seed),
            samples=FALLBACK_SAMPLES,
            smoothing=SMOOTHING,
        )
    except MotionFailed:
        return None


def ompl_pybullet(checker: CollisionChecker, query: MotionQuery, seed: int) -> np.ndarray | None:
    """OMPL's RRT-Connect with pybullet's checks, then as many attempts at a shortcut as ours."""
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
    body = np.concatenate([query.base, query.start])

    def valid(state: ob.State) -> bool:
        for joint in range(7):
            body[3 + joint] = state[joint]
        return checker.check_meshes(body) is None

    setup.setStateValidityChecker(valid)
    information.setStateValidityCheckingResolution(OMPL_RESOLUTION / space.getMaximumExtent())
    states = []
    for values in (query.start, query.goal):
        state = space.allocState()
        for joint in range(7):
            state[joint] = float(values[joint])
        states.append(state)
    if not all(information.isValid(state) for state in states):
        return None  # OMPL would wait for another goal
    setup.setStartAndGoalStates(*states)
    planner = og.RRTConnect(information)
    planner.setRange(8 * RESOLUTION)
    setup.setPlanner(planner)
    end = time.process_time() + OMPL_SECONDS
    setup.solve(ob.PlannerTerminationCondition(lambda: time.process_time() > end))
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    if path.getStateCount() > 2:
        og.PathSimplifier(information).partialShortcutPath(path, SMOOTHING, SMOOTHING, 1.0)
    return np.array([[state[joint] for joint in range(7)] for state in path.getStates()])


ARMS: dict[str, Arm] = {"ours": ours, "ompl_pybullet": ompl_pybullet, "mesh_fallback": mesh_fallback}

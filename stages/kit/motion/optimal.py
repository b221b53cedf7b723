"""Asymptotically optimal planning: OMPL's BIT* (Gammell, Srinivasa & Barfoot 2020, IJRR 39(5)), compiled checks.

The budget counts iterations of BIT*, never seconds. OMPL draws its random numbers itself: its generator is seeded from
ours before each query, and a query builds all of its objects anew, so that the same seed gives the same path. Of the
other planners in the wheel RRT* took a hundred times as long for longer paths (docs/MOTION.md).
"""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from schemas.errors import MissingDependency
from stages.kit.motion.collision import CollisionChecker
from stages.kit.motion.compiled_check import FREE, find_collision
from stages.kit.motion.compiled_rrt import count_refusal, way_is_free
from stages.kit.motion.failures import no_path
from stages.kit.motion.path_query import (
    Effort,
    Query,
    blockers,
    check_ends,
    compiled_free,
    confirm,
    is_free,
    may_differ,
    refusal_counts,
    shorten_path,
)
from stages.kit.motion.path_search import find_path
from stages.kit.motion.rrt_connect import without_repeats

BATCH = 100
"""Samples of one batch of BIT*."""


def optimal_path(
    query: Query,
    checker: CollisionChecker,
    random: np.random.Generator,
    *,
    iterations: int = 5000,
    smoothing: int = 60,
    effort: Effort | None = None,
) -> np.ndarray:
    """Return the shortest path (N, D) that was found within a budget, smoothed, and confirmed by the meshes.

    Lengths are measured in the values that move, each divided by its resolution. Where the compiled check refuses
    what the meshes might allow, `find_path` answers instead. Raises MotionFailed as it does (`no_path` counts
    iterations as samples), MissingDependency without OMPL.
    """
    effort = Effort() if effort is None else effort
    goals = check_ends(query, checker)
    counts = refusal_counts(checker)
    # OMPL waits for ever for ends that it can use: it gets those that the compiled check frees.
    usable = np.array([goal for goal in goals if compiled_free(query, goal, checker)])
    path = None
    if len(usable) and compiled_free(query, query.start, checker):
        path = _solve(query, usable, checker, random, iterations, counts, effort)
    if path is not None:
        for candidate in (shorten_path(query, path, checker, random, smoothing)[0], path):
            if is_free(query, candidate, checker, counts):
                if confirm(query, candidate, checker, effort) is None:
                    return candidate
                effort.rejected += 1
    if path is None and not may_differ(query, goals, checker, counts):
        raise no_path(iterations, blockers(counts, checker))
    return find_path(query, checker, random, samples=iterations, smoothing=smoothing, effort=effort)


@lru_cache(maxsize=1)
def _ompl() -> tuple[ModuleType, ModuleType, ModuleType, type]:
    """Return OMPL's base, geometric and util modules, and a validator of motions in which the compiled check looks."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise MissingDependency("the package ompl is not installed", hint="run `make setup`") from None

    class Straight(base.MotionValidator):  # type: ignore[misc]
        """Asks `look` whether the straight way between two states is free."""

        look: Any = None

        def checkMotion(self, begin: Any, end: Any, last: Any = None) -> bool:  # noqa: N802 (OMPL's name)
            return bool(self.look(begin, end))

    util.setLogLevel(util.LogLevel.LOG_NONE)
    return base, geometric, util, Straight


def _solve(
    query: Query, goals: np.ndarray, checker: CollisionChecker, random: np.random.Generator, iterations: int,
    counts: np.ndarray, effort: Effort,
) -> np.ndarray | None:  # fmt: skip
    base, geometric, util, straight = _ompl()
    robot, scene = checker.arrays()
    body = query.body.copy()
    dimension = len(query.start)
    resolution = query.space.resolution
    # OMPL measures in the unit of the value with the finest resolution: lengths far from 1 slow BIT* down.
    scale = resolution / resolution.min()
    space = base.RealVectorStateSpace(dimension)
    bounds = base.RealVectorBounds(dimension)
    for joint in range(dimension):
        bounds.setLow(joint, float(query.space.lower[joint] / scale[joint]))
        bounds.setHigh(joint, float(query.space.upper[joint] / scale[joint]))
    space.setBounds(bounds)
    # Every generator that OMPL makes from here on follows from this seed.
    util.RNG.setSeed(int(random.integers(1, 2**31)))
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()

    def values(state: Any) -> np.ndarray:
        return np.array([state[joint] for joint in range(dimension)]) * scale

    def valid(state: Any) -> bool:
        body[query.moving] = values(state)
        found, _, other = find_collision(robot, scene, body, query.first_frame)
        if found != FREE:
            count_refusal(counts, found, other, scene.allowed.shape[0])
        return bool(found == FREE)

    def look(begin: Any, end: Any) -> bool:
        return way_is_free(
            robot, scene, body, query.moving, query.first_frame, values(begin), values(end), resolution, counts
        )

    validator = straight(information)
    validator.look = look
    setup.setStateValidityChecker(valid)
    information.setMotionValidator(validator)
    _set_ends(setup, space, base, query.start / scale, goals / scale)
    planner = geometric.BITstar(information)
    planner.setSamplesPerBatch(BATCH)
    setup.setPlanner(planner)
    setup.solve(base.PlannerTerminationCondition(lambda: planner.numIterations() >= iterations))
    effort.samples += int(planner.numIterations())
    if not setup.haveExactSolutionPath():
        return None
    path = without_repeats(np.array([values(state) for state in setup.getSolutionPath().getStates()]))
    path[0] = query.start
    path[-1] = goals[int(np.abs(goals - path[-1]).max(axis=1).argmin())]
    return path


def _set_ends(setup: Any, space: Any, base: ModuleType, start: np.ndarray, goals: np.ndarray) -> None:
    """Give OMPL the start (D,) and the goals (G, D)."""

    def state_of(row: np.ndarray) -> Any:
        state = space.allocState()
        for joint, value in enumerate(row.tolist()):
            state[joint] = value
        return state

    setup.setStartState(state_of(start))
    region = base.GoalStates(setup.getSpaceInformation())
    for goal in goals:
        region.addState(state_of(goal))
    setup.setGoal(region)

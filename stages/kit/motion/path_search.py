"""Find a path: compiled search, compiled smoothing, confirmation of the result by the mesh checker.

The compiled check refuses a little more than the meshes do (by UNSURE at most). Where that may have been the reason for
not finding a path, the search goes on with the mesh checker deciding, so that no query is lost to the compiled model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.compiled_rrt import search
from scenewright.stages.kit.motion.failures import MotionFailed, no_path
from scenewright.stages.kit.motion.path_query import (
    Effort,
    Query,
    blockers,
    check_ends,
    compiled_free,
    confirm,
    is_free,
    may_differ,
    moving_arrays,
    refusal_counts,
    shorten_path,
)
from scenewright.stages.kit.motion.rrt_connect import FINER, first_collision, interpolate, rrt_connect, without_repeats

STEP = 16
"""Longest extension of a tree, in resolutions."""
MESH_SAMPLES, MESH_SMOOTHING = 2000, 60
"""Most samples that are drawn, and shortcuts tried, when the mesh checker has taken over: one of its checks costs as
much as ten compiled ones."""
ESCAPES = 120
"""Directions that are tried to leave a place too narrow for the compiled check."""
REJECTIONS = 4
"""Paths that the meshes reject before the mesh checker takes over the search."""


def find_path(
    query: Query,
    checker: CollisionChecker,
    random: np.random.Generator,
    *,
    samples: int = 2000,
    smoothing: int = 240,
    effort: Effort | None = None,
) -> np.ndarray:
    """Return a path (N, D) of straight pieces from the start to one of the goals, confirmed free by the mesh checker.

    Raises MotionFailed: `joint_limit`, `start_in_collision`, `goal_in_collision` (names, depth), `no_path` (the
    samples used and what blocked most often).
    """
    effort = Effort() if effort is None else effort
    goals = check_ends(query, checker)
    counts = refusal_counts(checker)
    # `effort` may hold what an earlier search took: the budget is this one's own.
    most_samples, most_rejected = effort.samples + samples, effort.rejected + REJECTIONS
    ways_out = [
        way_out for goal in goals if (way_out := leave_narrow(query, goal, checker, random, effort)) is not None
    ]
    start = leave_narrow(query, query.start, checker, random, effort)
    while start is not None and ways_out and effort.samples < most_samples and effort.rejected < most_rejected:
        path = _compiled_path(
            replace(query, start=start[-1]),
            np.array([way_out[-1] for way_out in ways_out]),
            checker,
            random,
            most_samples - effort.samples,
            smoothing,
            counts,
            effort,
        )
        if path is None:
            break
        last = next(way_out for way_out in ways_out if np.array_equal(way_out[-1], path[-1]))
        path = without_repeats(np.concatenate([start, path[1:], last[::-1][1:]]))
        if confirm(query, path, checker, effort) is None:
            return path
        effort.rejected += 1
    if effort.rejected or may_differ(query, goals, checker, counts):
        return _mesh_path(
            query, goals, checker, random, min(samples, MESH_SAMPLES), min(smoothing, MESH_SMOOTHING), effort
        )
    raise no_path(samples, blockers(counts, checker))


def leave_narrow(
    query: Query, end: np.ndarray, checker: CollisionChecker, random: np.random.Generator, effort: Effort
) -> np.ndarray | None:
    """Return a way (K, D) from an end (D,) to where the compiled check is free: the end alone when it is so there.

    A straight piece in a random direction, free for the meshes at FINER times the resolution; None when none of
    ESCAPES leads out.
    """
    if compiled_free(query, end, checker):
        return end[None]
    with effort.counting(checker):
        for number in range(ESCAPES):
            reach = query.space.resolution * (1 + 5 * number / ESCAPES)
            target = np.clip(end + random.uniform(-1, 1, len(end)) * reach, query.space.lower, query.space.upper)
            if compiled_free(query, target, checker):
                points = interpolate(end, target, query.space.resolution / FINER)
                if first_collision(points, lambda values: checker.check(query.whole(values))) is None:
                    return np.array([end, target])
    return None


def _compiled_path(
    query: Query,
    goals: np.ndarray,
    checker: CollisionChecker,
    random: np.random.Generator,
    samples: int,
    smoothing: int,
    counts: np.ndarray,
    effort: Effort,
) -> np.ndarray | None:
    """Return a smoothed path that is free for the compiled check at a finer resolution, or None."""
    space = query.space
    used = 0
    finer = 1
    while used < samples:
        motion = moving_arrays(query, space.resolution / finer, checker, counts)
        path, spent = search(motion, query.start, goals, space.lower, space.upper, samples - used, STEP * finer, random)
        used += spent
        effort.samples += spent
        if len(path) == 0:
            return None
        path = without_repeats(path)
        looked_at = None
        if len(path) > 2:
            path, looked_at = shorten_path(query, path, checker, random, smoothing)
        if is_free(query, path, checker, counts, looked_at):
            return path
        finer = FINER  # something thin lay between two checks; it will again
        used += 1
        effort.samples += 1
    return None


def _mesh_path(
    query: Query,
    goals: np.ndarray,
    checker: CollisionChecker,
    random: np.random.Generator,
    samples: int,
    smoothing: int,
    effort: Effort,
) -> np.ndarray:
    """Return a path found with the mesh checker deciding what the compiled one refuses. Raises MotionFailed."""
    effort.by_meshes = True
    last: MotionFailed | None = None
    with effort.counting(checker):
        for goal in goals:
            try:
                return rrt_connect(
                    query.start,
                    goal,
                    lambda values: checker.check(query.whole(values)),
                    query.space,
                    random,
                    samples=max(1, samples // len(goals)),
                    smoothing=smoothing,
                )
            except MotionFailed as failed:
                last = failed
    assert last is not None
    raise last

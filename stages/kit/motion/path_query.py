"""A search over some of the values of a configuration, and what both checkers say of its ends, points and paths."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.motion.collision import Collision, CollisionChecker
from scenewright.stages.kit.motion.compiled_check import FREE, find_collision
from scenewright.stages.kit.motion.compiled_rrt import UNCERTAIN_COUNT, Moving, shorten, way_is_free
from scenewright.stages.kit.motion.failures import end_in_collision, joint_limit
from scenewright.stages.kit.motion.rrt_connect import FINER, SearchSpace, densify, first_collision


@dataclass(frozen=True)
class Query:
    """A search over some of the values of a configuration; the others are held."""

    body: np.ndarray
    """(3 + J,) base and arm; where the others are held."""
    moving: np.ndarray
    """(D,) indices of the values that move."""
    start: np.ndarray
    """(D,)"""
    goals: np.ndarray
    """(G, D); a path to any of them answers the query."""
    space: SearchSpace
    """Bounds and resolution of the values that move."""

    def whole(self, values: np.ndarray) -> np.ndarray:
        """Return the configuration (3 + J,) with the moving values (D,) put in."""
        body = self.body.copy()
        body[self.moving] = values
        return body

    @property
    def first_frame(self) -> int:
        """The first frame of the robot that moves: 0 with the base, else the first joint's."""
        return int(self.moving.min()) - 2 if self.moving.min() >= 3 else 0


@dataclass
class Effort:
    """What an answer took."""

    samples: int = 0
    mesh_checks: int = 0
    rejected: int = 0
    """Paths that the mesh checker rejected on the way."""
    by_meshes: bool = False
    """Whether the mesh checker took over the search."""

    @contextmanager
    def counting(self, checker: CollisionChecker) -> Iterator[None]:
        """Count the checks of meshes that are made meanwhile."""
        before = checker.checks
        try:
            yield
        finally:
            self.mesh_checks += checker.checks - before


def check_ends(query: Query, checker: CollisionChecker) -> np.ndarray:
    """Return the goals (G', D) that are within limits and free.

    Raises MotionFailed `joint_limit`, `start_in_collision`, or `goal_in_collision` when none is left: with the names
    and the depth of the shallowest.
    """
    space = query.space
    if not space.holds(query.start):
        raise joint_limit("start", query.start, space.outside(query.start))
    collision = checker.check(query.whole(query.start))
    if collision is not None:
        raise end_in_collision("start", collision.part, collision.other, collision.depth)
    inside = [goal for goal in query.goals if space.holds(goal)]
    if not inside:
        raise joint_limit("goal", query.goals[0], space.outside(query.goals[0]))
    collisions = [checker.check(query.whole(goal)) for goal in inside]
    free = [goal for goal, collision in zip(inside, collisions, strict=True) if collision is None]
    if not free:
        shallowest = min((entry for entry in collisions if entry is not None), key=lambda entry: entry.depth)
        raise end_in_collision("goal", shallowest.part, shallowest.other, shallowest.depth)
    return np.array(free)


def refusal_counts(checker: CollisionChecker) -> np.ndarray:
    """Return zeros (1 + parts + groups,) for `compiled_rrt.count_refusal`."""
    _, scene = checker.arrays()
    return np.zeros(1 + sum(scene.allowed.shape), dtype=np.int64)


def blockers(counts: np.ndarray, checker: CollisionChecker) -> Counter[str]:
    """Return how often each link refused a step, by name."""
    part_count = len(checker.compiled.parts)
    result: Counter[str] = Counter()
    for index, hits in enumerate(counts[1:].tolist()):
        if hits:
            result[checker.other_name(index - part_count if index >= part_count else -1 - index)] += hits
    return result


def moving_arrays(query: Query, resolution: np.ndarray, checker: CollisionChecker, counts: np.ndarray) -> Moving:
    """Return what the compiled search reads of a query, at a resolution (D,); refusals are added to `counts`."""
    robot, scene = checker.arrays()
    return Moving(robot, scene, query.body.copy(), query.moving, query.first_frame, resolution, counts)


def compiled_free(query: Query, values: np.ndarray, checker: CollisionChecker) -> bool:
    """Whether moving values (D,) are free for the compiled check."""
    robot, scene = checker.arrays()
    return bool(find_collision(robot, scene, query.whole(values), 0)[0] == FREE)


def is_free(
    query: Query, path: np.ndarray, checker: CollisionChecker, counts: np.ndarray, looked_at: np.ndarray | None = None
) -> bool:
    """Whether a path (N, D) is free for the compiled check at FINER times the resolution. Pieces `looked_at` (N - 1,),
    which are, are not looked at again."""
    motion = moving_arrays(query, query.space.resolution / FINER, checker, counts)
    for number, (begin, end) in enumerate(zip(path[:-1], path[1:], strict=True)):
        if looked_at is not None and looked_at[number]:
            continue
        if not way_is_free(motion, begin, end):
            return False
    return True


def shorten_path(
    query: Query, path: np.ndarray, checker: CollisionChecker, random: np.random.Generator, attempts: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return a shorter path (M, D) and which of its pieces (M - 1,) are new, which are free for the compiled check at
    FINER times the resolution."""
    motion = moving_arrays(query, query.space.resolution / FINER, checker, refusal_counts(checker))
    return shorten(motion, path, attempts, random)


def may_differ(query: Query, goals: np.ndarray, checker: CollisionChecker, counts: np.ndarray) -> bool:
    """Whether the mesh checker might find a way where the compiled check does not.

    So it is when a refusal was uncertain, or one of the ends, free for the meshes, is not for the compiled check.
    """
    refused = any(not compiled_free(query, end, checker) for end in (query.start, *goals))
    return refused or bool(counts[UNCERTAIN_COUNT])


def confirm(query: Query, path: np.ndarray, checker: CollisionChecker, effort: Effort) -> Collision | None:
    """Return the first collision that the mesh checker sees on a path (N, D) in steps of the resolution, or None."""
    points = densify(path, query.space.resolution)
    with effort.counting(checker):
        collision_at = first_collision(points, lambda values: checker.check_meshes(query.whole(values)))
    return None if collision_at is None else collision_at[1]

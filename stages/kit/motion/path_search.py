"""Find a path: compiled search, compiled smoothing, confirmation of the result by the mesh checker.

The compiled check refuses a little more than the meshes do (by UNSURE at most). Where that may have been the reason for
not finding a path, the search goes on with the mesh checker deciding, so that no query is lost to the compiled model.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from stages.kit.motion.collision import Collision, CollisionChecker
from stages.kit.motion.compiled_check import FREE, find_collision
from stages.kit.motion.compiled_rrt import UNCERTAIN_COUNT, last_free, search, shorten
from stages.kit.motion.failures import MotionFailed
from stages.kit.motion.rrt_connect import FINER, SearchSpace, densify, first_collision, interpolate, rrt_connect

STEP = 8
"""Longest extension of a tree, in resolutions."""
MESH_SAMPLES = 2000
"""At most so many samples are drawn when the mesh checker has taken over: one costs as much as ten compiled ones."""
ESCAPES = 120
"""Directions that are tried to leave a place too narrow for the compiled check."""
REJECTIONS = 4
"""So many paths that the meshes reject, and the mesh checker takes over the search."""


@dataclass(frozen=True)
class Query:
    """A search over some of the values of a configuration; the others are held."""

    body: np.ndarray
    """(10,) base and arm; where the others are held."""
    moving: np.ndarray
    """(D,) indices of the values that move."""
    start: np.ndarray
    """(D,)"""
    goals: np.ndarray
    """(G, D); a path to any of them answers the query."""
    space: SearchSpace
    """Bounds and resolution of the values that move."""

    def whole(self, values: np.ndarray) -> np.ndarray:
        """Return the configuration (10,) with the moving values (D,) put in."""
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


def check_ends(query: Query, checker: CollisionChecker) -> np.ndarray:
    """Return the goals (G', D) that are within limits and free.

    Raises MotionFailed `joint_limit`, `start_in_collision`, or `goal_in_collision` when none is left: with the names
    and the depth of the shallowest.
    """
    require_limits("start", query.start, query.space)
    collision = checker.check(query.whole(query.start))
    if collision is not None:
        raise _in_collision("start", collision)
    inside = [goal for goal in query.goals if _outside(goal, query.space).max() <= 1e-6]
    if not inside:
        require_limits("goal", query.goals[0], query.space)
    found = [checker.check(query.whole(goal)) for goal in inside]
    free = [goal for goal, collision in zip(inside, found, strict=True) if collision is None]
    if not free:
        raise _in_collision("goal", min((entry for entry in found if entry is not None), key=lambda entry: entry.depth))
    return np.array(free)


def require_limits(name: str, point: np.ndarray, space: SearchSpace) -> None:
    """Raise MotionFailed `joint_limit` (joint, value, outside) when a point (D,) is outside the bounds."""
    outside = _outside(point, space)
    if outside.max() > 1e-6:
        joint = int(outside.argmax())
        raise MotionFailed(
            "joint_limit",
            f"the {name} puts joint {joint} {outside[joint]:.4f} outside its limits",
            numbers={"joint": joint, "value": point[joint], "outside": outside[joint]},
        )


def _outside(point: np.ndarray, space: SearchSpace) -> np.ndarray:
    return np.maximum(space.lower - point, point - space.upper)


def _in_collision(name: str, collision: Collision) -> MotionFailed:
    return MotionFailed(
        f"{name}_in_collision",
        f"at the {name}, {collision.part} is in collision with {collision.other} "
        f"(depth {1000 * collision.depth:.1f} mm)",
        (collision.part, collision.other),
        {"depth": collision.depth},
    )


def find_path(
    query: Query,
    checker: CollisionChecker,
    random: np.random.Generator,
    *,
    samples: int = 2000,
    smoothing: int = 60,
    effort: Effort | None = None,
) -> np.ndarray:
    """Return a path (N, D) of straight pieces from the start to one of the goals, confirmed free by the mesh checker.

    Raises MotionFailed: `joint_limit`, `start_in_collision`, `goal_in_collision` (names, depth), `no_path` (the
    samples used and what blocked most often).
    """
    effort = Effort() if effort is None else effort
    goals = check_ends(query, checker)
    counts = np.zeros(1 + len(checker.compiled.parts) + len(checker.compiled.groups), dtype=np.int64)
    ways = [way for goal in goals if (way := leave_narrow(query, goal, checker, random, effort)) is not None]
    start = leave_narrow(query, query.start, checker, random, effort)
    while start is not None and ways and effort.samples < samples and effort.rejected < REJECTIONS:
        path = _compiled_path(
            replace(query, start=start[-1]), np.array([way[-1] for way in ways]), checker, random,
            samples - effort.samples, smoothing, counts, effort,
        )  # fmt: skip
        if path is None:
            break
        last = next(way for way in ways if np.array_equal(way[-1], path[-1]))
        path = without_repeats(np.concatenate([start, path[1:], last[::-1][1:]]))
        if confirm(query, path, checker, effort) is None:
            return path
        effort.rejected += 1
    if effort.rejected or may_differ(query, goals, checker, counts):
        return _mesh_path(query, goals, checker, random, min(samples, MESH_SAMPLES), smoothing, effort)
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
    before = checker.checks
    found = None
    for number in range(ESCAPES):
        reach = query.space.resolution * (1 + 5 * number / ESCAPES)
        target = np.clip(end + random.uniform(-1, 1, len(end)) * reach, query.space.lower, query.space.upper)
        if compiled_free(query, target, checker):
            points = interpolate(end, target, query.space.resolution / FINER)
            if first_collision(points, lambda values: checker.check(query.whole(values))) is None:
                found = np.array([end, target])
                break
    effort.mesh_checks += checker.checks - before
    return found


def blockers(counts: np.ndarray, checker: CollisionChecker) -> Counter[str]:
    """Return how often each link refused a step, by name."""
    parts = len(checker.compiled.parts)
    result: Counter[str] = Counter()
    for index, hits in enumerate(counts[1:].tolist()):
        if hits:
            result[checker.other_name(index - parts if index >= parts else -1 - index)] += hits
    return result


def no_path(samples: int, hits: Counter[str]) -> MotionFailed:
    """Return the failure of a search that used up its samples, with what blocked most often."""
    worst, count = hits.most_common(1)[0] if hits else ("", 0)
    return MotionFailed(
        "no_path",
        f"no path within {samples} samples; {worst or 'nothing'} blocked most ({count} of {hits.total()} collisions)",
        (worst,) if worst else (),
        {"samples": samples, "hits": count},
    )


def confirm(query: Query, path: np.ndarray, checker: CollisionChecker, effort: Effort) -> Collision | None:
    """Return the first collision that the mesh checker sees on a path (N, D) in steps of the resolution, or None."""
    before = checker.checks
    collision = None
    for point in densify(path, query.space.resolution):
        collision = checker.check_meshes(query.whole(point))
        if collision is not None:
            break
    effort.mesh_checks += checker.checks - before
    return collision


def _compiled_path(
    query: Query, goals: np.ndarray, checker: CollisionChecker, random: np.random.Generator, samples: int,
    smoothing: int, counts: np.ndarray, effort: Effort,
) -> np.ndarray | None:  # fmt: skip
    """Return a smoothed path that is free for the compiled check at a finer resolution, or None."""
    robot, scene = checker.arrays()
    space = query.space
    used = 0
    finer = 1
    while used < samples:
        path, spent = search(
            robot, scene, query.body.copy(), query.moving, query.first_frame, query.start, goals, space.lower,
            space.upper, space.resolution / finer, samples - used, STEP * finer, random, counts,
        )  # fmt: skip
        used += spent
        effort.samples += spent
        if len(path) == 0:
            return None
        path = without_repeats(path)
        if len(path) > 2:
            path = shorten_path(query, path, checker, random, smoothing)
        if is_free(query, path, checker, counts):
            return path
        finer = FINER  # something thin lay between two checks; it will again
        used += 1
        effort.samples += 1
    return None


def shorten_path(
    query: Query, path: np.ndarray, checker: CollisionChecker, random: np.random.Generator, attempts: int
) -> np.ndarray:
    """Return a shorter path (M, D), its new pieces free for the compiled check at FINER times the resolution."""
    robot, scene = checker.arrays()
    return shorten(
        robot, scene, query.body.copy(), query.moving, query.first_frame, path, query.space.resolution / FINER,
        attempts, random,
    )  # fmt: skip


def is_free(query: Query, path: np.ndarray, checker: CollisionChecker, counts: np.ndarray) -> bool:
    """Whether a path (N, D) is free for the compiled check at FINER times the resolution."""
    robot, scene = checker.arrays()
    body = query.body.copy()
    for begin, end in zip(path[:-1], path[1:], strict=True):
        free, steps = last_free(
            robot, scene, body, query.moving, query.first_frame, begin, end, query.space.resolution / FINER, 1_000_000,
            counts,
        )  # fmt: skip
        if free < steps:
            return False
    return True


def may_differ(query: Query, goals: np.ndarray, checker: CollisionChecker, counts: np.ndarray) -> bool:
    """Whether the mesh checker might find a way where the compiled check does not.

    So it is when a refusal was uncertain, or one of the ends, free for the meshes, is not for the compiled check.
    """
    refused = any(not compiled_free(query, end, checker) for end in (query.start, *goals))
    return refused or bool(counts[UNCERTAIN_COUNT])


def compiled_free(query: Query, values: np.ndarray, checker: CollisionChecker) -> bool:
    """Whether moving values (D,) are free for the compiled check."""
    robot, scene = checker.arrays()
    return bool(find_collision(robot, scene, query.whole(values), 0)[0] == FREE)


def _mesh_path(
    query: Query, goals: np.ndarray, checker: CollisionChecker, random: np.random.Generator, samples: int,
    smoothing: int, effort: Effort,
) -> np.ndarray:  # fmt: skip
    """Return a path found with the mesh checker deciding what the compiled one refuses. Raises MotionFailed."""
    effort.by_meshes = True
    before = checker.checks
    last: MotionFailed | None = None
    for goal in goals:
        try:
            return rrt_connect(
                query.start, goal, lambda values: checker.check(query.whole(values)), query.space, random,
                samples=max(1, samples // len(goals)), smoothing=smoothing,
            )  # fmt: skip
        except MotionFailed as failed:
            last = failed
        finally:
            effort.mesh_checks += checker.checks - before
            before = checker.checks
    assert last is not None
    raise last


def without_repeats(path: np.ndarray) -> np.ndarray:
    """Return the path (M, D) without points equal to the one before."""
    keep = np.concatenate([[True], np.any(np.abs(np.diff(path, axis=0)) > 1e-12, axis=1)])
    return path[keep]

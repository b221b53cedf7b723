"""RRT-Connect (Kuffner & LaValle 2000) and shortcut smoothing, all loops compiled.

A search moves some of the values of a configuration (3 + J,) and holds the others still. Motions are straight in the
values that move; they are looked at in steps in which no value changes by more than its resolution.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.motion.compiled_arrays import RobotArrays, SceneArrays
from scenewright.stages.kit.motion.compiled_check import FREE, UNCERTAIN, find_collision

UNCERTAIN_COUNT = 0
"""Place in the counts of refusals that the mesh checker might not share; the others follow."""
LEAST_GAIN, LEAST_PARTIAL_GAIN = 0.5, 4.0
"""Smallest gains of a shortcut, straight and partial, in resolutions: those that save less are not looked at."""
WHOLE_WAY = 1_000_000
"""Most steps of any way, and so the `most` of `last_free` that stops nowhere."""


class Moving(NamedTuple):
    """What moves in which scene, and how finely its motions are looked at."""

    robot: RobotArrays
    scene: SceneArrays
    body: np.ndarray
    """(3 + J,) scratch: the values that do not move are read from it."""
    moving: np.ndarray
    """(D,) indices of the values that move."""
    first_frame: int
    """The first frame of the robot that moves."""
    resolution: np.ndarray
    """(D,) no step changes a value by more."""
    counts: np.ndarray
    """(1 + parts + groups,) what refused is added, see `count_refusal`."""


@compiled(error_model="numpy")
def count_refusal(counts: np.ndarray, state: int, other: int, parts: int) -> None:
    """Count what refused: counts are (1 + parts + groups,)."""
    if state == UNCERTAIN:
        counts[UNCERTAIN_COUNT] += 1
    counts[1 + parts + other if other >= 0 else -other] += 1


@compiled(error_model="numpy")
def _step_count(begin: np.ndarray, end: np.ndarray, resolution: np.ndarray) -> int:
    steps = 1
    for k in range(begin.shape[0]):
        steps = max(steps, int(np.ceil(abs(end[k] - begin[k]) / resolution[k] - 1e-9)))
    return steps


@compiled(error_model="numpy")
def last_free(motion: Moving, begin: np.ndarray, end: np.ndarray, most: int) -> tuple[int, int]:
    """Return how many steps from `begin` (D,) towards `end` are free, and how many the whole way has.

    No more than `most` steps are looked at.
    """
    robot, scene, body, moving, first_frame, resolution, counts = motion
    steps = _step_count(begin, end, resolution)
    for number in range(1, min(steps, most) + 1):
        share = number / steps
        for k in range(begin.shape[0]):
            body[moving[k]] = begin[k] + (end[k] - begin[k]) * share
        state, _, obstacle = find_collision(robot, scene, body, first_frame)
        if state != FREE:
            count_refusal(counts, state, obstacle, scene.allowed.shape[0])
            return number - 1, steps
    return min(steps, most), steps


@compiled(error_model="numpy")
def way_is_free(motion: Moving, begin: np.ndarray, end: np.ndarray) -> bool:
    """Return whether all steps of `last_free` are free, looked at from coarse to fine: a way that is blocked is
    mostly blocked in its middle, and then few looks tell."""
    robot, scene, body, moving, first_frame, resolution, counts = motion
    steps = _step_count(begin, end, resolution)
    stride = 1
    while stride < steps:
        stride *= 2
    while stride >= 1:
        for number in range(stride, steps, 2 * stride):
            share = number / steps
            for k in range(begin.shape[0]):
                body[moving[k]] = begin[k] + (end[k] - begin[k]) * share
            state, _, obstacle = find_collision(robot, scene, body, first_frame)
            if state != FREE:
                count_refusal(counts, state, obstacle, scene.allowed.shape[0])
                return False
        stride //= 2
    for k in range(begin.shape[0]):
        body[moving[k]] = end[k]
    state, _, obstacle = find_collision(robot, scene, body, first_frame)
    if state != FREE:
        count_refusal(counts, state, obstacle, scene.allowed.shape[0])
    return bool(state == FREE)


@compiled(error_model="numpy")
def _nearest(points: np.ndarray, count: int, target: np.ndarray, resolution: np.ndarray) -> int:
    best, least = 0, np.inf
    for index in range(count):
        total = 0.0
        for k in range(target.shape[0]):
            value = (points[index, k] - target[k]) / resolution[k]
            total += value * value
        if total < least:
            best, least = index, total
    return best


@compiled(error_model="numpy")
def _grown(points: np.ndarray, parents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    more_points = np.empty((2 * points.shape[0], points.shape[1]))
    more_parents = np.empty(2 * parents.shape[0], dtype=np.int64)
    more_points[: points.shape[0]] = points
    more_parents[: parents.shape[0]] = parents
    return more_points, more_parents


@compiled(error_model="numpy")
def search(
    motion: Moving,
    start: np.ndarray,
    goals: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    samples: int,
    step: int,
    random: np.random.Generator,
) -> tuple[np.ndarray, int]:
    """Return a free path (N, D) from `start` (D,) to one of `goals` (G, D) within `lower` and `upper` (D,), and the
    samples used.

    The path is empty when `samples` did not suffice. `step` is the longest extension in resolutions. All goals are
    roots of the second tree. The smaller tree grows (LaValle 2006, Planning Algorithms, section 5.5.3): the one that
    is in a narrow place finds few ways, and needs most of the samples.
    """
    resolution = motion.resolution
    dimension = start.shape[0]
    points_a, parents_a = np.empty((256, dimension)), np.empty(256, dtype=np.int64)
    points_b, parents_b = np.empty((256 + goals.shape[0], dimension)), np.empty(256 + goals.shape[0], dtype=np.int64)
    points_a[0], parents_a[0] = start, -1
    for number in range(goals.shape[0]):
        points_b[number], parents_b[number] = goals[number], -1
    count_a, count_b = 1, goals.shape[0]
    for number in range(goals.shape[0]):
        free, steps = last_free(motion, start, goals[number], WHOLE_WAY)
        if free == steps:
            path = np.empty((2, dimension))
            path[0], path[1] = start, goals[number]
            return path, 0
    forward = True
    sample = np.empty(dimension)
    for used in range(1, samples + 1):
        for k in range(dimension):
            sample[k] = lower[k] + (upper[k] - lower[k]) * random.random()
        nearest = _nearest(points_a, count_a, sample, resolution)
        free, steps = last_free(motion, points_a[nearest], sample, step)
        if free > 0:
            if count_a + 1 >= points_a.shape[0]:
                points_a, parents_a = _grown(points_a, parents_a)
            points_a[count_a] = points_a[nearest] + (sample - points_a[nearest]) * (free / steps)
            parents_a[count_a] = nearest
            count_a += 1
            target = points_a[count_a - 1].copy()
            nearest = _nearest(points_b, count_b, target, resolution)
            origin = points_b[nearest].copy()
            free, steps = last_free(motion, origin, target, WHOLE_WAY)
            parent = nearest
            done = 0
            while done < free:
                done = min(done + step, free)
                if count_b + 1 >= points_b.shape[0]:
                    points_b, parents_b = _grown(points_b, parents_b)
                points_b[count_b] = origin + (target - origin) * (done / steps)
                parents_b[count_b] = parent
                parent = count_b
                count_b += 1
            if free == steps:
                points_b[parent] = target
                if forward:
                    return _join_trees(points_a, parents_a, count_a - 1, points_b, parents_b, parent), used
                return _join_trees(points_b, parents_b, parent, points_a, parents_a, count_a - 1), used
        if count_a < count_b:
            continue
        points_a, points_b = points_b, points_a
        parents_a, parents_b = parents_b, parents_a
        count_a, count_b = count_b, count_a
        forward = not forward
    return np.empty((0, dimension)), samples


@compiled(error_model="numpy")
def _join_trees(
    points_a: np.ndarray, parents_a: np.ndarray, node_a: int, points_b: np.ndarray, parents_b: np.ndarray, node_b: int
) -> np.ndarray:
    """Return the path from the root of tree a to node_a, which is node_b, and on to a root of tree b."""
    length_a, length_b = 0, 0
    node = node_a
    while node >= 0:
        length_a += 1
        node = parents_a[node]
    node = parents_b[node_b]
    while node >= 0:
        length_b += 1
        node = parents_b[node]
    path = np.empty((length_a + length_b, points_a.shape[1]))
    node = node_a
    for row in range(length_a - 1, -1, -1):
        path[row] = points_a[node]
        node = parents_a[node]
    node = parents_b[node_b]
    for row in range(length_a, length_a + length_b):
        path[row] = points_b[node]
        node = parents_b[node]
    return path


@compiled(error_model="numpy")
def _length(rows: np.ndarray, resolution: np.ndarray) -> float:
    """Return the Euclidean length of a path (N, D) in resolutions."""
    total = 0.0
    for row in range(1, rows.shape[0]):
        square = 0.0
        for k in range(rows.shape[1]):
            value = (rows[row, k] - rows[row - 1, k]) / resolution[k]
            square += value * value
        total += np.sqrt(square)
    return total


@compiled(error_model="numpy")
def _path_is_free(motion: Moving, rows: np.ndarray) -> bool:
    """Whether the pieces between rows (N, D), of which the first and last are free, are: its bends are looked at
    first."""
    for row in range(1, rows.shape[0] - 1):
        for k in range(rows.shape[1]):
            motion.body[motion.moving[k]] = rows[row, k]
        if find_collision(motion.robot, motion.scene, motion.body, motion.first_frame)[0] != FREE:
            return False
    for row in range(1, rows.shape[0]):  # noqa: SIM110 (numba has no `all`)
        if not way_is_free(motion, rows[row - 1], rows[row]):
            return False
    return True


@compiled(error_model="numpy")
def shorten(
    motion: Moving, path: np.ndarray, attempts: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return a shorter path (M, D), and which of its pieces (M - 1,) are new, and thus free at this resolution.

    Pairs of random points on it are joined, where that is free and shorter, in turn by a straight piece and by one in
    which a single value goes straight while the others keep to the path (the partial shortcut of Geraerts & Overmars
    2007, IJRR 26(8)): where all of them together cannot, most of them still can. The latter are asked to save more,
    as they take more looks.
    """
    resolution = motion.resolution
    dimension = path.shape[1]
    rows = path.copy()
    count = path.shape[0]
    looked_at = np.zeros(count - 1, dtype=np.bool_)
    ends = np.zeros(count + 2 * attempts + 2)
    for attempt in range(attempts):
        if count < 3:
            break
        for row in range(1, count):
            ends[row] = ends[row - 1] + _length(rows[row - 1 : row + 1], resolution)
        low, high = ends[count - 1] * random.random(), ends[count - 1] * random.random()
        if low > high:
            low, high = high, low
        i = min(np.searchsorted(ends[:count], low, side="right") - 1, count - 2)
        j = min(np.searchsorted(ends[:count], high, side="right") - 1, count - 2)
        if i == j:
            continue
        span = np.empty((j - i + 2, dimension))
        along = (low - ends[i]) / max(ends[i + 1] - ends[i], 1e-12)
        span[0] = rows[i] + (rows[i + 1] - rows[i]) * along
        span[1:-1] = rows[i + 1 : j + 1]
        along = (high - ends[j]) / max(ends[j + 1] - ends[j], 1e-12)
        span[-1] = rows[j] + (rows[j + 1] - rows[j]) * along
        if attempt % 2 == 0:
            piece = np.empty((2, dimension))
            piece[0], piece[1] = span[0], span[-1]
        else:
            piece = span.copy()
            k = int(dimension * random.random())
            for row in range(1, span.shape[0] - 1):
                piece[row, k] = span[0, k] + (span[-1, k] - span[0, k]) * (ends[i + row] - low) / (high - low)
        if _length(piece, resolution) > high - low - (LEAST_GAIN if attempt % 2 == 0 else LEAST_PARTIAL_GAIN):
            continue  # hardly shorter
        if not _path_is_free(motion, piece):
            continue
        inner = piece.shape[0]
        fresh = np.empty((count - (j - i) + inner, dimension))
        fresh[: i + 1] = rows[: i + 1]
        fresh[i + 1 : i + 1 + inner] = piece
        fresh[i + 1 + inner :] = rows[j + 1 : count]
        is_checked = np.empty(fresh.shape[0] - 1, dtype=np.bool_)
        is_checked[: i + 1] = looked_at[: i + 1]
        is_checked[i + 1 : i + inner] = True
        is_checked[i + inner :] = looked_at[j:]
        rows, looked_at = fresh, is_checked
        count = rows.shape[0]
    return rows, looked_at

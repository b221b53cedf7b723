"""Distance of two convex hulls (Gilbert, Johnson & Keerthi 1988, IEEE J-RA 4(2)), with bounds and early ends.

The closest point of a simplex to the origin follows Ericson, "Real-Time Collision Detection", sections 5.1.5 and 5.1.6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled

ITERATIONS = 48
"""Most iterations of a distance; by eye."""
PRECISION = 1e-5
"""The two bounds of a distance are this near to each other [m] when nothing ends the search earlier."""


class Hull(NamedTuple):
    """The convex hull of the vertices `begin` to `end` of an array (V, 3) [m], put at a pose (3, 4)."""

    vertices: np.ndarray
    begin: int
    end: int
    pose: np.ndarray


@compiled(error_model="numpy", inline="always")
def _extreme(hull: Hull, direction: np.ndarray, sign: float) -> int:
    """Return the index of the vertex that lies farthest along sign * direction (world)."""
    vertices, begin, end, pose = hull
    x = sign * (pose[0, 0] * direction[0] + pose[1, 0] * direction[1] + pose[2, 0] * direction[2])
    y = sign * (pose[0, 1] * direction[0] + pose[1, 1] * direction[1] + pose[2, 1] * direction[2])
    z = sign * (pose[0, 2] * direction[0] + pose[1, 2] * direction[1] + pose[2, 2] * direction[2])
    best = begin
    most = -np.inf
    for index in range(begin, end):
        value = x * vertices[index, 0] + y * vertices[index, 1] + z * vertices[index, 2]
        if value > most:
            most = value
            best = index
    return best


@compiled(error_model="numpy")
def _nearest_on_segment(simplex: np.ndarray, a: int, b: int, weights: np.ndarray) -> None:
    dot, square = 0.0, 0.0
    for k in range(3):
        along = simplex[b, k] - simplex[a, k]
        dot -= simplex[a, k] * along
        square += along * along
    share = 0.0 if square < 1e-18 else min(max(dot / square, 0.0), 1.0)
    weights[:] = 0.0
    weights[a] = 1.0 - share
    weights[b] += share


@compiled(error_model="numpy")
def _nearest_on_triangle(simplex: np.ndarray, a: int, b: int, c: int, weights: np.ndarray) -> None:
    d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        ab, ac = simplex[b, k] - simplex[a, k], simplex[c, k] - simplex[a, k]
        d1 -= ab * simplex[a, k]
        d2 -= ac * simplex[a, k]
        d3 -= ab * simplex[b, k]
        d4 -= ac * simplex[b, k]
        d5 -= ab * simplex[c, k]
        d6 -= ac * simplex[c, k]
    weights[:] = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        weights[a] = 1.0
        return
    if d3 >= 0.0 and d4 <= d3:
        weights[b] = 1.0
        return
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        _nearest_on_segment(simplex, a, b, weights)
        return
    if d6 >= 0.0 and d5 <= d6:
        weights[c] = 1.0
        return
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        _nearest_on_segment(simplex, a, c, weights)
        return
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        _nearest_on_segment(simplex, b, c, weights)
        return
    total = va + vb + vc
    if total < 1e-24:
        _nearest_on_segment(simplex, a, b, weights)
        return
    weights[b] = vb / total
    weights[c] = vc / total
    weights[a] = 1.0 - weights[b] - weights[c]


@compiled(error_model="numpy")
def _outside(simplex: np.ndarray, a: int, b: int, c: int, d: int) -> bool:
    """Whether the origin and corner d lie on different sides of the plane a, b, c, or the corners are in one plane."""
    ux, uy, uz = (simplex[b, 0] - simplex[a, 0], simplex[b, 1] - simplex[a, 1], simplex[b, 2] - simplex[a, 2])
    vx, vy, vz = (simplex[c, 0] - simplex[a, 0], simplex[c, 1] - simplex[a, 1], simplex[c, 2] - simplex[a, 2])
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    origin = -(nx * simplex[a, 0] + ny * simplex[a, 1] + nz * simplex[a, 2])
    corner = (
        nx * (simplex[d, 0] - simplex[a, 0])
        + ny * (simplex[d, 1] - simplex[a, 1])
        + nz * (simplex[d, 2] - simplex[a, 2])
    )
    return origin * corner <= 0.0


@compiled(error_model="numpy")
def _nearest_on_tetrahedron(simplex: np.ndarray, weights: np.ndarray) -> bool:
    """Write the weights of the nearest point; return True when the origin lies inside."""
    trial = np.zeros(4)
    best = np.inf
    inside = True
    for omitted in range(4):
        a, b, c = (omitted + 1) % 4, (omitted + 2) % 4, (omitted + 3) % 4
        if _outside(simplex, a, b, c, omitted):
            inside = False
            _nearest_on_triangle(simplex, a, b, c, trial)
            square = 0.0
            for k in range(3):
                value = 0.0
                for corner in range(4):
                    value += trial[corner] * simplex[corner, k]
                square += value * value
            if square < best:
                best = square
                weights[:] = trial
    return inside


@compiled(error_model="numpy")
def convex_distance(first: Hull, second: Hull, enough: float, too_near: float) -> tuple[float, float]:
    """Return a lower and an upper bound [m] of the distance of two convex hulls; 0, 0 when they overlap.

    The search ends as soon as the lower bound exceeds `enough` or the upper one is below `too_near`, otherwise when
    both agree to PRECISION.
    """
    first_pose, second_pose = first.pose, second.pose
    simplex = np.zeros((4, 3))
    weights = np.zeros(4)
    nearest = np.zeros(3)
    for k in range(3):
        nearest[k] = first_pose[k, 3] - second_pose[k, 3]
        for axis in range(3):
            nearest[k] += first_pose[k, axis] * first.vertices[first.begin, axis]
            nearest[k] -= second_pose[k, axis] * second.vertices[second.begin, axis]
    count = 0
    lower = 0.0
    length = np.sqrt(nearest[0] ** 2 + nearest[1] ** 2 + nearest[2] ** 2)
    upper = length
    for _ in range(ITERATIONS):
        if upper < 1e-9:
            return 0.0, 0.0
        if upper < too_near:
            return lower, upper
        i = _extreme(first, nearest, -1.0)
        j = _extreme(second, nearest, 1.0)
        along = 0.0
        for k in range(3):
            value = first_pose[k, 3] - second_pose[k, 3]
            for axis in range(3):
                value += first_pose[k, axis] * first.vertices[i, axis] - second_pose[k, axis] * second.vertices[j, axis]
            simplex[count, k] = value
            along += value * nearest[k]
        lower = max(lower, along / length)
        if lower > enough or upper - lower < PRECISION:
            return lower, upper
        for corner in range(count):
            same = True
            for k in range(3):
                same = same and abs(simplex[corner, k] - simplex[count, k]) < 1e-12
            if same:
                return lower, upper
        count += 1
        if count == 1:
            weights[:] = 0.0
            weights[0] = 1.0
        elif count == 2:
            _nearest_on_segment(simplex, 0, 1, weights)
        elif count == 3:
            _nearest_on_triangle(simplex, 0, 1, 2, weights)
        elif _nearest_on_tetrahedron(simplex, weights):
            return 0.0, 0.0
        nearest[:] = 0.0
        kept_count = 0
        for corner in range(count):
            if weights[corner] > 0.0:
                for k in range(3):
                    nearest[k] += weights[corner] * simplex[corner, k]
                    simplex[kept_count, k] = simplex[corner, k]
                kept_count += 1
        count = kept_count
        length = np.sqrt(nearest[0] ** 2 + nearest[1] ** 2 + nearest[2] ** 2)
        upper = min(upper, length)
        if count == 4:
            return 0.0, upper
    return lower, upper

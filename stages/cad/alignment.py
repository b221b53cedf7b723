"""Optimization-based CAD alignment: equations 2.11 to 2.14 of Han 2024, by Levenberg-Marquardt."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scenewright.stages.cad.matching import CUBE_ROTATIONS, Match
from scenewright.stages.kit.compiled import compiled

STEP = 1e-6
"""Step of the forward difference (the released code's)."""


@dataclass(frozen=True)
class AlignmentWeights:
    """Diagonals of Sigma_b and Sigma_p (2.12); the thesis gives no values, these names are those of its code."""

    support: float
    offset: float
    angle: float
    containment: float
    height: float


@dataclass(frozen=True)
class Alignment:
    """T of equation 2.11: scale alpha, yaw theta, position p of the centre of the CAD model's box."""

    scale: float
    yaw: float
    position: np.ndarray
    """(3,) world [m]."""
    cost: float
    """J (2.12) at the solution."""


@compiled
def rectangle(center: np.ndarray, size: np.ndarray, yaw: float) -> np.ndarray:
    """Return the corners (4, 2) of a ground rectangle, counter-clockwise, from centre, full lengths and yaw [rad]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    corners = np.empty((4, 2))
    for k in range(4):
        x = 0.5 * size[0] * (-1.0 if k in (0, 3) else 1.0)
        y = 0.5 * size[1] * (-1.0 if k in (0, 1) else 1.0)
        corners[k, 0] = cosine * x - sine * y + center[0]
        corners[k, 1] = sine * x + cosine * y + center[1]
    return corners


@compiled
def convex_overlap_area(subject: np.ndarray, clip: np.ndarray) -> float:
    """Return the area [m^2] that two convex counter-clockwise polygons (K, 2), (M, 2) share (Sutherland-Hodgman).

    As boxes.clip_polygon; spelled out because the alignment asks for it at every evaluation.
    """
    count = len(subject)
    points = np.empty((count + len(clip) + 4, 2))
    points[:count] = subject
    clipped = np.empty_like(points)
    for m in range(len(clip)):
        sx, sy = clip[m, 0], clip[m, 1]
        ex, ey = clip[(m + 1) % len(clip), 0] - sx, clip[(m + 1) % len(clip), 1] - sy
        total = 0
        for k in range(count):
            b = (k - 1) % count
            side = ex * (points[k, 1] - sy) - ey * (points[k, 0] - sx)
            before = ex * (points[b, 1] - sy) - ey * (points[b, 0] - sx)
            if (side >= 0.0) != (before >= 0.0):
                share = before / (before - side)
                clipped[total] = points[b] + share * (points[k] - points[b])
                total += 1
            if side >= 0.0:
                clipped[total] = points[k]
                total += 1
        count = total
        points[:count] = clipped[:count]
        if count == 0:
            return 0.0
    area = 0.0
    for k in range(count):
        ahead = (k + 1) % count
        x, y = points[k, 0] - points[0, 0], points[k, 1] - points[0, 1]
        area += x * (points[ahead, 1] - points[0, 1]) - y * (points[ahead, 0] - points[0, 0])
    return max(0.0, 0.5 * area)


@compiled
def turn_about_z(yaw: float) -> np.ndarray:
    """Return the (3, 3) rotation by `yaw` [rad] about z."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


@compiled
def box_errors(
    center_x: np.ndarray,
    size_x: np.ndarray,
    yaw_x: float,
    size_y: np.ndarray,
    scale: float,
    yaw: float,
    position: np.ndarray,
) -> np.ndarray:
    """Equation 2.13: [A(T o y) - A(x n T o y), alpha s_y - s_x], with `size_y` (3,) of the oriented model."""
    mine = rectangle(position, scale * size_y, yaw)
    theirs = rectangle(center_x, size_x, yaw_x)
    outside = scale**2 * size_y[0] * size_y[1] - convex_overlap_area(mine, theirs)
    return np.array([outside, scale * size_y[2] - size_x[2]])


@compiled
def plane_errors(
    normals_x: np.ndarray, offsets_x: np.ndarray, normals_y: np.ndarray, offsets_y: np.ndarray, shift: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Equation 2.14 for matched planes: (offset differences (M,), 1 - cosines (M,)).

    Normals (M, 3) in the world frame. `offsets_x` are relative to the centre of x, `offsets_y` (already scaled) to
    that of y, which lies at `shift` (3,) from the centre of x: T^-T f(pi) has offset d_y - n . shift. The centre of x
    is the origin, as offsets from the far origin of the map would weigh every error of yaw by that distance.
    """
    along = normals_y[:, 0] * shift[0] + normals_y[:, 1] * shift[1] + normals_y[:, 2] * shift[2]
    return offsets_y - along - offsets_x, 1.0 - (normals_x * normals_y).sum(axis=1)


class _Fixed(NamedTuple):
    """What the residuals of a match depend on beside the parameters: object x, oriented model y, M matched planes."""

    center_x: np.ndarray
    """(3,) [m]"""
    size_x: np.ndarray
    """(3,) [m]"""
    yaw_x: float
    """[rad]"""
    support_height: float
    """[m]"""
    size_y: np.ndarray
    """(3,) [m]"""
    normals_x: np.ndarray
    """(M, 3)"""
    offsets_x: np.ndarray
    """(M,) [m]"""
    normals_y: np.ndarray
    offsets_y: np.ndarray
    offset_weight: np.ndarray
    """(M,) roots of the weights, as the two below."""
    angle_weight: float
    box_weight: np.ndarray
    """(2,) containment and height."""


@compiled
def _residuals(parameters: np.ndarray, fixed: _Fixed) -> np.ndarray:
    """e of equation 2.12, times the roots of the weights. Compiled, as every candidate asks for it 200 times."""
    size_y, normals_y = fixed.size_y, fixed.normals_y
    scale, yaw = parameters[0], parameters[1]
    position = np.array([parameters[2], parameters[3], fixed.support_height + scale * size_y[2] / 2])
    cosine, sine = math.cos(yaw), math.sin(yaw)
    turned = np.empty_like(normals_y)
    turned[:, 0] = cosine * normals_y[:, 0] - sine * normals_y[:, 1]
    turned[:, 1] = sine * normals_y[:, 0] + cosine * normals_y[:, 1]
    turned[:, 2] = normals_y[:, 2]
    offset, angle = plane_errors(
        fixed.normals_x, fixed.offsets_x, turned, scale * fixed.offsets_y, position - fixed.center_x
    )
    box = box_errors(fixed.center_x, fixed.size_x, fixed.yaw_x, size_y, scale, yaw, position)
    return np.concatenate((fixed.box_weight * box, fixed.offset_weight * offset, fixed.angle_weight * angle))


@compiled
def _residual_rows(rows: np.ndarray, fixed: _Fixed) -> np.ndarray:
    first = _residuals(rows[0], fixed)
    residuals = np.empty((len(rows), len(first)))
    residuals[0] = first
    for k in range(1, len(rows)):
        residuals[k] = _residuals(rows[k], fixed)
    return residuals


def residual_function(match: Match, weights: AlignmentWeights) -> Callable[[np.ndarray], np.ndarray]:
    """Return e(alpha, theta, px, py), of rows (N, 4), with J = e^T e (2.12); p_z follows from the support:
    p = -d^s + alpha s_y / 2."""
    frame, shape = match.frame, match.shape
    rotation = CUBE_ROTATIONS[match.orientation]
    rows = np.array([pair[0] for pair in match.pairs], dtype=int)
    columns = np.array([pair[1] for pair in match.pairs], dtype=int)
    carries = frame.planes.supporting[rows]
    fixed = _Fixed(
        np.asarray(frame.center, dtype=float),
        np.asarray(frame.size, dtype=float),
        float(frame.yaw),
        float(frame.support_height),
        np.abs(rotation) @ shape.size,
        np.ascontiguousarray(frame.planes.normals[rows]),
        frame.planes.offsets[rows],
        np.ascontiguousarray(shape.planes.normals[columns] @ rotation.T),
        shape.planes.offsets[columns],
        np.sqrt(np.where(carries, weights.support, weights.offset)),
        math.sqrt(weights.angle),
        np.sqrt([weights.containment, weights.height]),
    )
    return lambda rows: _residual_rows(rows, fixed)


def levenberg_marquardt(
    residuals: Callable[[np.ndarray], np.ndarray], start: np.ndarray, evaluations: int, tolerance: float = 1e-8
) -> tuple[np.ndarray, float]:
    """Return (parameters (K,), squared norm) that minimise |residuals|^2 from `start` (K,).

    `residuals` takes rows (N, K), (N, M) come back. Forward differences; works with fewer residuals than parameters, as
    damping keeps the normal matrix regular. Stops after `evaluations` rows or when a step changes the cost by less than
    `tolerance` of it.
    """
    x = np.asarray(start, dtype=float).copy()
    value = residuals(x[None])[0]
    cost, calls, damping = float(value @ value), 1, 1e-3
    ahead = STEP * np.eye(len(x))
    while calls < evaluations:
        jacobian = np.ascontiguousarray(((residuals(x + ahead) - value) / STEP).T)
        calls += len(x)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ value
        improved = False
        while calls < evaluations and damping < 1e12:
            lifted = normal.copy()
            diagonal = lifted.reshape(-1)[:: len(x) + 1]
            diagonal += damping * np.maximum(diagonal, 1e-6)
            diagonal += 1e-9
            step = -np.linalg.solve(lifted, gradient)
            trial = residuals((x + step)[None])[0]
            calls += 1
            trial_cost = float(trial @ trial)
            if trial_cost < cost:
                gain = cost - trial_cost
                x, value, damping, improved = x + step, trial, damping / 10, gain > tolerance * cost
                cost = trial_cost
                break
            damping *= 10
        if not improved:
            break
    return x, cost


def unaligned(match: Match, scale_range: tuple[float, float] = (0.0, math.inf)) -> Alignment:
    """Return where the matching puts a candidate: equal diagonals (as far as `scale_range` allows), yaw and centre of
    the object's frame, foot on the support. Its cost is not known."""
    frame, size_y = match.frame, np.abs(CUBE_ROTATIONS[match.orientation]) @ match.shape.size
    ratio = float(np.linalg.norm(frame.size) / np.linalg.norm(match.shape.size))
    scale = min(max(ratio, scale_range[0]), scale_range[1])
    height = frame.support_height + scale * size_y[2] / 2
    return Alignment(scale, frame.yaw, np.array([*frame.center[:2], height]), math.inf)


def align(
    match: Match, weights: AlignmentWeights, evaluations: int, scale_range: tuple[float, float] = (0.0, math.inf)
) -> Alignment:
    """Return the alignment of one oriented candidate (section 2.4.3), started at equal diagonals, yaw and centre.

    A scale outside `scale_range` is taken to its end: an object of which a part was seen, or that took a piece of its
    neighbour, has a box that fits no model."""
    frame, size_y = match.frame, np.abs(CUBE_ROTATIONS[match.orientation]) @ match.shape.size
    first = unaligned(match, scale_range)
    start = np.array([first.scale, first.yaw, *first.position[:2]])
    solution, cost = levenberg_marquardt(residual_function(match, weights), start, evaluations)
    scale = min(max(float(solution[0]), scale_range[0]), scale_range[1])
    height = frame.support_height + scale * size_y[2] / 2
    return Alignment(scale, float(solution[1]), np.array([solution[2], solution[3], height]), cost)

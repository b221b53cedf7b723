"""How a thing that is looked at from near by lies, and how large it is: its planned shape turned, moved and scaled onto
the points that were seen of it.

A reconstruction makes small things smaller than they are, by up to a seventh: the fingers that close on a cup have less
room than that. And what fell lies otherwise than it stood. Both show in how well the shape fits, asked both ways: what
was seen should be of the shape, and what of the shape faces the camera should have been seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.measurement.pose_error import align_rigidly
from scenewright.stages.plan.pose_fit import SURE, align_upright
from scipy.spatial import cKDTree

FEW, MANY = 300, 800
"""Points seen that a first and a last fit go by."""
ROUNDS = 16
"""Steps of one fit; by eye."""
KEPT = 0.95
"""Share of the seen points, the nearest, that a round goes by: a handle, which tells the heading, is a tenth."""
SCALES, FINER = np.linspace(0.8, 1.25, 10), (-0.025, -0.0125, 0.0125, 0.025)
"""Sizes that are tried, of the planned one, and then around the best of them."""
HEADINGS, ROLLS = 8, 4
"""Ways in which a thing may lie on its side."""
HOPEFUL = 3
"""Attitudes that are fitted in all sizes, besides the believed one."""
FITS = 0.003
"""No shape fits what a depth camera saw better than about this [m]."""
LEVEL = 0.95
"""Upward share of its axis above which a thing stands, on its foot or upside down."""
FAR = 0.03
"""A point farther off counts as this far [m]."""
BESIDE = 0.008
"""A point nearer to the shape is as far from it as from its surface there: points on it are sparse [m]."""
FACING = 0.3
"""Least cosine between a surface's normal and the way to the camera: flatter ones depth cameras hardly see."""
CELL, BEHIND = 0.01, 0.015
"""Breadth of a bundle of rays, and how far behind what it meets first a surface is hidden by it [m]."""


@dataclass(frozen=True)
class FittedThing:
    """How a thing lies."""

    pose: np.ndarray
    """(4, 4) from the frame of its shape, which is to be scaled first."""
    scale: float
    misfit: float
    """Mean distance of what was seen from the shape, plus that of what faces a camera from what was seen [m]."""


def fit_thing(
    seen: np.ndarray, eyes: np.ndarray, shape: tuple[np.ndarray, np.ndarray], believed: np.ndarray
) -> FittedThing:
    """Return how a thing lies and how large it is.

    `seen` (N, 3): points of it that cameras at `eyes` (K, 3) saw; `shape`: points (M, 3) around it and their outward
    normals, own frame; `believed`: its pose (4, 4), from which another attitude must be better by `SURE`.
    """
    few_points, many_points = _thin_out(seen, FEW), _thin_out(seen, MANY)
    turned = [_yaw(2 * np.pi * k / HEADINGS) @ believed[:3, :3] for k in range(HEADINGS)]
    first = _best_scale(
        many_points, eyes, shape, _hopeful(few_points, eyes, shape, turned, upright=True)[0], upright=True
    )
    if first.misfit < FITS + SURE:
        return first
    others = [first]
    for pose in _hopeful(few_points, eyes, shape, _attitudes(), upright=False)[:HOPEFUL]:
        stands = abs(pose[2, 2]) > LEVEL
        others.append(_best_scale(many_points, eyes, shape, _upright(pose) if stands else pose, upright=stands))
    best = min(others, key=lambda fit: fit.misfit)
    return best if best.misfit < first.misfit - SURE else first


def _hopeful(
    seen_points: np.ndarray,
    eyes: np.ndarray,
    shape: tuple[np.ndarray, np.ndarray],
    attitudes: list[np.ndarray],
    *,
    upright: bool,
) -> list[np.ndarray]:
    """Return the poses (4, 4) that a fit from each of the attitudes (3, 3) ends in, those that fit best first."""
    poses = [
        _fit_pose(seen_points, shape[0], _over(seen_points, shape[0], turn), upright=upright) for turn in attitudes
    ]
    return sorted(poses, key=lambda pose: _misfit(seen_points, eyes, shape, pose))


def _thin_out(points: np.ndarray, most: int) -> np.ndarray:
    return points[:: max(1, len(points) // most)]


def _yaw(angle: float) -> np.ndarray:
    """Return the turn (3, 3) about the vertical by an angle [rad]."""
    turn: np.ndarray = transform_from_yaw(angle, np.zeros(3))[:3, :3]
    return turn


def _upright(pose: np.ndarray) -> np.ndarray:
    """Return the pose (4, 4) with its axis made vertical."""
    turn = _yaw(float(np.arctan2(pose[1, 0], pose[0, 0])))
    level = pose.copy()
    level[:3, :3] = turn if pose[2, 2] > 0 else turn @ np.diag([1.0, -1.0, -1.0])
    return level


def _attitudes() -> list[np.ndarray]:
    """Return rotations (3, 3) in which a thing that stood may lie: upright, upside down, on its side."""
    rotations = []
    for heading in 2 * np.pi * np.arange(HEADINGS) / HEADINGS:
        axis = np.array([np.cos(heading), np.sin(heading), 0.0])
        across = np.array([-axis[1], axis[0], 0.0])
        for roll in 2 * np.pi * np.arange(ROLLS) / ROLLS:
            side = np.cos(roll) * across + np.sin(roll) * np.array([0.0, 0.0, 1.0])
            rotations.append(np.column_stack([side, np.cross(axis, side), axis]))
    for k in range(ROLLS):
        rotations += [_yaw(2 * np.pi * k / ROLLS), _yaw(2 * np.pi * k / ROLLS) @ np.diag([1.0, -1.0, -1.0])]
    return rotations


def _over(seen_points: np.ndarray, shape: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the pose (4, 4) in an attitude in which the boxes' middles are one over the other, tops level."""
    turned_shape = shape @ turn.T
    low, high = np.percentile(seen_points, 2, axis=0), np.percentile(seen_points, 98, axis=0)
    pose = np.eye(4)
    pose[:3, :3] = turn
    pose[:2, 3] = (low + high - turned_shape.min(axis=0) - turned_shape.max(axis=0))[:2] / 2
    pose[2, 3] = high[2] - turned_shape[:, 2].max()
    return pose


def _fit_pose(seen_points: np.ndarray, shape: np.ndarray, pose: np.ndarray, *, upright: bool) -> np.ndarray:
    """Return the pose (4, 4) near a first one at which the seen points lie nearest to the shape, trimmed; `upright`: it
    is turned about the vertical only."""
    tree = cKDTree(shape)
    for _ in range(ROUNDS):
        away, nearest = tree.query(apply(inverse(pose), seen_points))
        nearest_rows = np.argsort(away, kind="stable")[: max(3, int(KEPT * len(seen_points)))]
        source, target = apply(pose, shape[nearest[nearest_rows]]), seen_points[nearest_rows]
        pose = (align_upright if upright else align_rigidly)(source, target) @ pose
    return pose


def _best_scale(
    seen_points: np.ndarray, eyes: np.ndarray, shape: tuple[np.ndarray, np.ndarray], pose: np.ndarray, *, upright: bool
) -> FittedThing:
    """Return the fit in the size that fits best, tops level with the top that it begins with."""

    def fitted(scale: float) -> FittedThing:
        scaled_shape = (scale * shape[0], shape[1])
        start = pose.copy()
        start[2, 3] += (1 - scale) * float((shape[0] @ pose[2, :3]).max())
        fitted_pose = _fit_pose(seen_points, scaled_shape[0], start, upright=upright)
        return FittedThing(fitted_pose, scale, _misfit(seen_points, eyes, scaled_shape, fitted_pose))

    best = min(map(fitted, SCALES.tolist()), key=lambda fit: fit.misfit)
    return min([best, *(fitted(best.scale + step) for step in FINER)], key=lambda fit: fit.misfit)


def _misfit(seen_points: np.ndarray, eyes: np.ndarray, shape: tuple[np.ndarray, np.ndarray], pose: np.ndarray) -> float:
    points, normals = apply(pose, shape[0]), shape[1] @ pose[:3, :3].T
    away, nearest = cKDTree(points).query(seen_points)
    beside = np.abs(np.einsum("ij,ij->i", seen_points - points[nearest], normals[nearest]))
    outward = float(np.minimum(np.where(away < BESIDE, beside, away), FAR).mean())
    visible = np.zeros(len(points), dtype=bool)
    for eye in eyes:
        visible |= in_sight(points, normals, eye)
    if not visible.any():
        return 2 * FAR
    away = np.sort(np.minimum(cKDTree(seen_points).query(points[visible])[0], FAR))
    return outward + float(away[: max(1, int(KEPT * len(away)))].mean())


def in_sight(points: np.ndarray, normals: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return (N,) bool: points (N, 3) of a surface, outward normals given, that face an eye (3,) and that the rest
    of it does not hide."""
    rays = eye - points
    away = np.linalg.norm(rays, axis=1)
    facing = np.einsum("ij,ij->i", rays, normals) > FACING * away
    cells = np.floor(-rays / away[:, None] * away.min() / CELL).astype(int)
    _, number = np.unique(cells, axis=0, return_inverse=True)
    nearest = np.full(number.max() + 1, np.inf)
    np.minimum.at(nearest, number.reshape(-1), away)
    return facing & (away < nearest[number.reshape(-1)] + BEHIND)

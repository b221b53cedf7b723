"""Walls found by geometry alone: upright planes behind which nothing that faces the same way was seen.

Ours. A front of cabinets has a wall behind it, which shows above it or beside it; a wall has none. So a surface is of a
wall where, in its upright column, nothing is seen shortly behind it, and such columns make up a long and high plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

UPRIGHT = 0.25
"""Cosine to the vertical that the normals of what stands upright stay under."""
FACING = np.cos(np.radians(15))
"""Cosine to a wall's normal over which surface faces as it does."""
DIRECTIONS = 72
"""Directions in which planes of walls are looked for; each plane is fitted after."""
COLUMN, COLUMN_AREA = 0.15, 0.01
"""Width [m] of upright columns, and the area [m^2] under which nothing was seen in one."""
THICKNESS = 0.06
"""Largest distance from the plane of a wall of what is the wall: frames, switches, errors of the map [m]."""
BEHIND = 1.2
"""How far behind a surface another one is looked for [m]."""
WITHIN = 0.3
"""Largest distance behind the plane of what belongs to the wall: reveals, what shines through [m]."""
LEAST_AREA, LEAST_LENGTH, LEAST_HEIGHT = 0.3, 1.0, 1.3
"""Least measures of a wall: area [m^2], columns in all [m], and the height [m] over the floor that a quarter of them
reach."""
OPENING = 1.2
"""Narrower gaps between columns belong to the wall: openings, and what hides it [m]."""


@dataclass(frozen=True)
class _Plane:
    normal: np.ndarray
    """(2,) horizontal, into the room."""
    offset: float
    columns: np.ndarray
    """Numbers of the columns that were seen, ascending."""


def of_walls(vertices: np.ndarray, normals: np.ndarray, candidates: np.ndarray, voxel: float) -> np.ndarray:
    """Return which of the `candidates` (V,) lie on a wall, or close behind one.

    vertices (V, 3) [m], z up, the floor at 0; normals (V, 3); `voxel` [m], a vertex stands for one voxel of surface.
    """
    on_walls = np.zeros(len(vertices), bool)
    for plane in _planes(vertices, normals, candidates, voxel):
        gaps = zip(plane.columns[:-1], plane.columns[1:], strict=True)
        hidden = [np.arange(a, b) for a, b in gaps if (b - a) * COLUMN < OPENING]
        span = np.concatenate([plane.columns, *hidden])
        distance = vertices[:, :2] @ plane.normal - plane.offset
        at_plane = (distance < THICKNESS) & (distance > -WITHIN)
        on_walls |= at_plane & np.isin(
            _columns(vertices[:, :2], plane.normal), np.concatenate([span - 1, span, span + 1])
        )
    return on_walls & candidates


def _planes(vertices: np.ndarray, normals: np.ndarray, candidates: np.ndarray, voxel: float) -> list[_Plane]:
    """Return the planes of walls, the one with most surface first; what one explains makes no other."""
    upright = np.flatnonzero(candidates & (np.abs(normals[:, 2]) < UPRIGHT))
    points, height = vertices[upright, :2], vertices[upright, 2]
    facing = normals[upright, :2] / np.linalg.norm(normals[upright, :2], axis=1, keepdims=True)
    fewest = COLUMN_AREA / voxel**2
    unexplained = np.ones(len(upright), bool)
    views = []
    for angle in np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS:
        axis = np.array([np.cos(angle), np.sin(angle)])
        outermost = _outermost(points, np.flatnonzero(facing @ axis > FACING), axis, fewest)
        views.append((axis, outermost, points[outermost] @ axis))
    planes: list[_Plane] = []
    while True:
        most, axis, start = 0, np.zeros(2), 0.0
        for direction, outermost, distance in views:
            free = distance[unexplained[outermost]]
            if len(free) > most:
                counts = np.bincount(np.floor((free - free.min()) / THICKNESS).astype(int))
                counts = counts + np.append(counts[1:], 0)
                if counts.max() > most:
                    most, axis = int(counts.max()), direction
                    start = float(free.min()) + (int(counts.argmax()) + 1) * THICKNESS
        if most * voxel**2 < LEAST_AREA:
            return planes
        normal, offset = _fit_plane(points, facing, axis, start)
        on_plane = _outermost(points, np.flatnonzero(facing @ normal > FACING), normal, fewest)
        on_plane = on_plane[np.abs(points[on_plane] @ normal - offset) < THICKNESS]
        unexplained[on_plane] = False
        unexplained &= (facing @ axis <= FACING) | (
            np.abs(points @ axis - start) > 1.01 * THICKNESS
        )  # all that was counted
        columns, inverse = np.unique(_columns(points[on_plane], normal), return_inverse=True)
        top = np.full(len(columns), -np.inf)
        np.maximum.at(top, inverse, height[on_plane])
        full_columns = np.bincount(inverse, minlength=len(columns)) >= fewest
        if full_columns.sum() * COLUMN >= LEAST_LENGTH and np.quantile(top[full_columns], 0.75) >= LEAST_HEIGHT:
            planes.append(_Plane(normal, offset, columns[full_columns]))


def _columns(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the number of the column (N,) of points (N, 2) along a wall with this normal."""
    return np.floor(points @ np.array([-normal[1], normal[0]]) / COLUMN).astype(int)


def _outermost(points: np.ndarray, chosen: np.ndarray, normal: np.ndarray, fewest: float) -> np.ndarray:
    """Return those of the `chosen` points (numbers) behind which fewer than `fewest` of them lie in their column."""
    key = _columns(points[chosen], normal) * 1000.0 + points[chosen] @ normal  # maps are smaller than a kilometre
    ordered = np.sort(key)
    behind = np.searchsorted(ordered, key - THICKNESS) - np.searchsorted(ordered, key - BEHIND)
    return chosen[behind < fewest]


def _fit_plane(points: np.ndarray, facing: np.ndarray, axis: np.ndarray, start: float) -> tuple[np.ndarray, float]:
    """Return normal (2,) and offset of the plane that fits what lies around a first one best."""
    normal, offset = axis, start
    for _ in range(3):
        inliers = points[(facing @ normal > FACING) & (np.abs(points @ normal - offset) < THICKNESS)]
        if len(inliers) < 2:
            break
        across = np.linalg.svd(inliers - inliers.mean(axis=0), full_matrices=False)[2][1]
        normal = across * np.sign(across @ axis)
        offset = float(np.median(inliers @ normal))
    return normal, offset

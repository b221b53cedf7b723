"""Points and finer meshes thinned to cubes, and how the surface lies around a point."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.cells import row_keys
from scipy.spatial import cKDTree

NEIGHBOURS = 12
"""Points around one that say how the surface lies there."""


def thinned(
    vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray, instance: np.ndarray, edge: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, faces, colours and instances with one vertex, the mean, for what an instance has in each cube of
    `edge` [m]; faces that collapse or come twice are gone."""
    cubes = np.floor(vertices / edge).astype(np.int64)
    keys = np.column_stack([cubes, instance])
    _, inverse = np.unique(row_keys(keys), return_inverse=True)
    count = np.bincount(inverse)
    means = np.stack([np.bincount(inverse, weights=vertices[:, k]) / count for k in range(3)], axis=1)
    paint = np.stack([np.bincount(inverse, weights=colors[:, k]) / count for k in range(3)], axis=1)
    owner = np.zeros(len(count), dtype=np.int64)
    owner[inverse] = instance
    corners = inverse[faces]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    turn = corners.argmin(axis=1)[:, None] if len(corners) else np.zeros((0, 1), dtype=np.int64)
    corners = np.unique(np.take_along_axis(corners, (turn + np.arange(3)) % 3, axis=1), axis=0)
    return means, corners, np.rint(paint).astype(np.uint8), owner


def tiles_of_points(
    points: np.ndarray, colors: np.ndarray, instance: np.ndarray, edge: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, faces, colours and instances of a small square for each cube of `edge` [m] that holds points of
    an instance, in the plane of the NEIGHBOURS nearest points; it looks up."""
    none = np.zeros((0, 3), dtype=np.int64)
    middles, _, paint, owner = thinned(points, none, colors, instance, edge)
    distance, axes = local_axes(middles)
    normal, first, second = axes[:, :, 0], axes[:, :, 2], axes[:, :, 1]
    spacing = 0.5 * np.clip(np.median(distance[:, 1:5], axis=1), edge, 4 * edge)[:, None]
    flip = (normal[:, 2] < 0) ^ (np.einsum("ni,ni->n", np.cross(first, second), normal) < 0)
    second = np.where(flip[:, None], -second, second)
    corners = [-first - second, first - second, first + second, -first + second]
    vertices = np.stack([middles + spacing * corner for corner in corners], axis=1).reshape(-1, 3)
    base = 4 * np.arange(len(middles))[:, None]
    faces = np.concatenate([base + [0, 1, 2], base + [0, 2, 3]])
    return vertices, faces, np.repeat(paint, 4, axis=0), np.repeat(owner, 4)


def local_axes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (N, K) [m] to the NEIGHBOURS nearest points, itself first, and axes (N, 3, 3) of the plane
    through them: the first column is normal to it, its sign whatever it is."""
    distance, neighbours = cKDTree(points).query(points, k=min(NEIGHBOURS, len(points)))
    neighbours = neighbours.reshape(len(points), -1)
    around = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    return distance.reshape(len(points), -1), np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1]

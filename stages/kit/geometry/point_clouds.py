"""Oriented points of triangle meshes: normals, even sampling, thinning to a grid, stray clusters."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.cells import row_keys
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

MOST_SAMPLES = 50_000_000
"""Points on the large triangles of one mesh: 2,500 m^2 at a centimetre."""


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals (V, 3) of vertices (V, 3): area-weighted means of the faces (F, 3) around them.

    Vertices without a face get (0, 0, 1).
    """
    corners = vertices[faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(vertices), 3))
    for axis in range(3):
        contribution = np.repeat(weighted[:, axis], 3)
        normals[:, axis] = np.bincount(faces.ravel(), weights=contribution, minlength=len(vertices))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 1e-12, normals / np.maximum(length, 1e-12), [0.0, 0.0, 1.0])


def vertex_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the area (V,) [m^2] that each vertex (V, 3) stands for: a third of that of the faces (F, 3) around it."""
    corners = vertices[faces]
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.bincount(faces.ravel(), weights=np.repeat(twice / 6, 3), minlength=len(vertices))


def normals_of_neighbours(neighbours: np.ndarray) -> np.ndarray:
    """Return unit normals (N, 3), of either sign, of planes through neighbours (N, K, 3) of points: the direction
    in which they vary least."""
    centred = neighbours - neighbours.mean(axis=1, keepdims=True)
    normals: np.ndarray = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred))[1][:, :, 0]
    return normals


def sample_large_triangles(
    vertices: np.ndarray, faces: np.ndarray, spacing: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (K, 3) and unit normals on triangles that are larger than a grid of `spacing` [m].

    Meshes of a TSDF have vertices everywhere and add nothing; a box of twelve triangles needs this to be seen.
    About one point falls on each spacing^2 / 2 of area. Raises BadInput when that were over `MOST_SAMPLES`.
    """
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    with np.errstate(over="ignore"):
        needed = np.where(area > spacing**2, np.ceil(2.0 * area / spacing**2), 0)
    if not needed.sum() <= MOST_SAMPLES:
        raise BadInput(
            f"a surface of {area.sum():.3g} m^2 is too large for points {spacing:g} m apart",
            hint="its mesh may be damaged",
        )
    counts = needed.astype(int)
    owner = np.repeat(np.arange(len(faces)), counts)
    u, v = random.random((2, len(owner), 1))
    flip = u + v > 1.0
    u, v = np.where(flip, 1.0 - u, u), np.where(flip, 1.0 - v, v)
    a, b, c = corners[owner, 0], corners[owner, 1], corners[owner, 2]
    points = a + u * (b - a) + v * (c - a)
    return points, cross[owner] / np.maximum(2.0 * area[owner, None], 1e-18)


def thin_to_grid(points: np.ndarray, normals: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return one point (mean) and unit normal (mean) for each cube of edge `spacing` [m] that holds points (N, 3).

    The two faces of a board thinner than the cube must not be averaged, so points of a cube whose normals point to
    opposite sides of its first axis stay apart. The order is that of the cubes.
    """
    if len(points) == 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    cubes = np.floor(points / spacing).astype(np.int64)
    dominant = np.argmax(np.abs(normals), axis=1)
    side = 2 * dominant + (normals[np.arange(len(normals)), dominant] > 0)
    keys = np.concatenate([cubes - cubes.min(axis=0), side[:, None]], axis=1)
    span = keys.max(axis=0) + 1
    flat = ((keys[:, 0] * span[1] + keys[:, 1]) * span[2] + keys[:, 2]) * span[3] + keys[:, 3]
    _, group = np.unique(flat, return_inverse=True)
    count = np.bincount(group)
    mean_points = np.stack([np.bincount(group, weights=points[:, k]) for k in range(3)], axis=1) / count[:, None]
    mean_normals = np.stack([np.bincount(group, weights=normals[:, k]) for k in range(3)], axis=1)
    length = np.linalg.norm(mean_normals, axis=1, keepdims=True)
    mean_normals = np.where(length > 1e-9, mean_normals / np.maximum(length, 1e-9), [0.0, 0.0, 1.0])
    return mean_points, mean_normals


def clusters(points: np.ndarray, distance: float) -> np.ndarray:
    """Return the cluster number (N,) of points (N, 3); points nearer than about `distance` [m] belong together.

    Single linkage of the cells (edge distance / 2) that hold points, two cells apart at most, so a gap between
    `distance` / 2 and 1.5 * `distance` separates. Numbered from the largest cluster; equal ones by their first point.
    """
    count = len(points)
    if count == 0:
        return np.zeros(0, dtype=int)
    edge = distance / 2
    all_cells = np.floor(points / edge).astype(np.int64)
    _, first_index, cell_of = np.unique(row_keys(all_cells), return_index=True, return_inverse=True)
    cells = all_cells[first_index]
    pairs = cKDTree(cells).query_pairs(2.0, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    label = connected_components(links, directed=False)[1][cell_of]
    sizes = np.bincount(label)
    first = np.full(len(sizes), count)
    np.minimum.at(first, label, np.arange(count))
    rank = np.empty(len(sizes), dtype=int)
    rank[np.lexsort((first, -sizes))] = np.arange(len(sizes))
    return rank[label]


def linked(points: np.ndarray, norm: float = 2.0) -> list[np.ndarray]:
    """Return the rows of each group of points (N, D) that hang together by steps of length 1 at most: exact single
    linkage, for few points. `norm`: p of the lengths; infinity bounds each axis apart."""
    if len(points) == 0:
        return []
    pairs = cKDTree(points).query_pairs(1.0, p=norm, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    number = connected_components(links, directed=False)[1]
    return [np.flatnonzero(number == each) for each in range(number.max() + 1)]


def middle_of(points: np.ndarray) -> np.ndarray:
    """Return the point (3,) of points (N, 3), N >= 1, nearest their median [m]: the middle of a box about a corner of
    walls lies in the air."""
    return np.asarray(points[int(np.linalg.norm(points - np.median(points, axis=0), axis=1).argmin())])


def without_strays(points: np.ndarray, share: float, distance: float) -> np.ndarray:
    """Return (N,) bool: which points (N, 3) are no stray clusters.

    A cluster is stray when it holds less than `share` of the points and lies farther than `distance` [m] from all
    that is kept (labels that leaked onto a wall behind the object). Larger ones stay, however far: a chair's legs are
    often cut off from its seat. Clusters are judged from the largest down.
    """
    keep = np.ones(len(points), dtype=bool)
    if len(points) == 0:
        return keep
    label = clusters(points, distance)
    sizes = np.bincount(label)
    # Clusters are farther than `distance` from each other by construction.
    keep = sizes[label] >= share * len(points)
    keep |= label == 0
    return keep

"""Even points of a labelled surface."""

from __future__ import annotations

import numpy as np

MOST_POINTS = 200_000_000
"""Most points that may be laid on a surface; a guard against what does not fit into memory, by eye."""


def surface_points(
    vertices: np.ndarray, faces: np.ndarray, labels: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) float32 [m], one in each cube of edge `spacing` [m] that the surface runs through, and the
    label (N,) int32 of each: that of the corner of its triangle with the largest barycentric weight.

    vertices (V, 3), faces (F, 3), labels (V,). Triangles are laid with a regular lattice finer than the cubes, so
    that coarse meshes are covered too. Of several points in one cube the first counts (in the order of the faces).
    Raises ValueError when the surface is so large that more than MOST_POINTS points would have to be laid.
    """
    corners = vertices[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1) if len(faces) else np.zeros(0)
    steps = np.maximum(1, np.ceil(edges / (0.7 * spacing))).astype(np.int64)
    if float(((steps + 1.0) * (steps + 2.0) / 2.0).sum()) > MOST_POINTS:
        raise ValueError(f"the surface has more than {MOST_POINTS} points of {spacing:g} m")
    points, point_labels, order = [], [], []
    for step in np.unique(steps):
        chosen = np.flatnonzero(steps == step)
        weights = _lattice(int(step))
        points.append(np.einsum("kc,fcd->fkd", weights, corners[chosen]).reshape(-1, 3))
        point_labels.append(labels[faces[chosen]][:, weights.argmax(axis=1)].reshape(-1))
        order.append(np.repeat(chosen, len(weights)))
    if not points:
        return np.zeros((0, 3), np.float32), np.zeros(0, np.int32)
    in_order = np.argsort(np.concatenate(order), kind="stable")
    positions = np.concatenate(points)[in_order]
    cells = np.floor(positions / spacing).astype(np.int64)
    cells -= cells.min(axis=0)
    span = cells.max(axis=0) + 1
    _, first = np.unique((cells[:, 2] * span[1] + cells[:, 1]) * span[0] + cells[:, 0], return_index=True)
    first.sort()
    return positions[first].astype(np.float32), np.concatenate(point_labels)[in_order][first].astype(np.int32)


def _lattice(step: int) -> np.ndarray:
    """Barycentric weights (K, 3) of the points that cut each edge of a triangle into `step` parts."""
    first, second = np.meshgrid(np.arange(step + 1), np.arange(step + 1), indexing="ij")
    inside = first + second <= step
    pairs = np.stack([first[inside], second[inside]], axis=1) / step
    return np.column_stack([pairs, 1.0 - pairs.sum(axis=1)])

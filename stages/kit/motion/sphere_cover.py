"""Cover a convex hull with balls: cut it into convex cells and put a ball around each, so that nothing is left out."""

from __future__ import annotations

import heapq

import numpy as np
from scipy.spatial import ConvexHull, QhullError

ROUNDS = 200
"""Rounds of the iteration for the smallest ball; more make it a little smaller, any number makes it a cover."""


def enclosing_ball(points: np.ndarray) -> np.ndarray:
    """Return centre and radius (4,) of a nearly smallest ball that holds points (N, 3) (Badoiu & Clarkson 2003)."""
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    best = np.array([*center, np.linalg.norm(points - center, axis=1).max()])
    for step in range(1, ROUNDS + 1):
        distances = np.linalg.norm(points - center, axis=1)
        farthest = int(distances.argmax())
        if distances[farthest] < best[3]:
            best = np.array([*center, distances[farthest]])
        center = center + (points[farthest] - center) / (step + 1)
    return best


def hull_vertices(points: np.ndarray) -> np.ndarray:
    """Return the vertices (V, 3) of the convex hull of points (N, 3); flat sets of points come back as they are."""
    try:
        return points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return np.unique(points, axis=0)


def sphere_cover(vertices: np.ndarray, most: int, smallest: float) -> np.ndarray:
    """Return balls (K, 4), K <= `most`, whose union holds the convex hull of `vertices` (V, 3).

    The cell with the largest ball is halved across its longest side until there are `most` or the largest ball is
    smaller than `smallest` [m]. Cells are cut exactly (a convex set cut by a plane), a ball holds all corners of its
    cell and so the cell: the cover holds by construction.
    """
    ball = enclosing_ball(vertices)
    cells = [(-float(ball[3]), 0, vertices, ball)]
    number = 1
    while len(cells) < most and -cells[0][0] > smallest:
        _, _, cell, _ = heapq.heappop(cells)
        for half in _halves(cell):
            ball = enclosing_ball(half)
            heapq.heappush(cells, (-float(ball[3]), number, half, ball))
            number += 1
    return np.array([entry[3] for entry in sorted(cells, key=lambda entry: entry[1])])


def _halves(cell: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of both halves of a convex cell (V, 3), cut across its longest side."""
    middle = cell.mean(axis=0)
    axis = np.linalg.svd(cell - middle, full_matrices=False)[2][0]
    heights = cell @ axis
    heights = heights - (heights.min() + heights.max()) / 2
    above, below = cell[heights >= 0], cell[heights <= 0]
    top, bottom = heights[heights >= 0], heights[heights <= 0]
    # Segments between all pairs across the plane: more than the edges, but all of them lie in the cell.
    share = (top[:, None] / np.maximum(top[:, None] - bottom[None, :], 1e-12))[..., None]
    crossing = (above[:, None] + share * (below[None] - above[:, None])).reshape(-1, 3)
    return hull_vertices(np.concatenate([above, crossing])), hull_vertices(np.concatenate([below, crossing]))

"""A convex piece without what lies in a box: the rest of it as convex pieces."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.convex_pieces import hull_volume
from scipy.spatial import ConvexHull, QhullError

THINNEST = 0.004
"""What of a piece is thinner along an axis is left out [m]."""


def outside_box(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Return the corners (N, 3) of convex pieces that make up the hull of `points` (M, 3) [m] outside of a box along
    the axes, `low` and `high` (3,): at most one a face of the box, the largest first, none thinner than 4 mm.

    Of what lies beyond two faces at once the piece beyond the one that leaves most has it.
    """
    pieces, remaining = [], points
    faces = [(axis, sign, sign * (high if sign > 0 else low)[axis]) for axis in range(3) for sign in (1.0, -1.0)]
    while faces and len(remaining):
        beyond = [half(remaining, axis, sign, limit) for axis, sign, limit in faces]
        volumes = [_volume(part) for part in beyond]
        best = int(np.argmax(volumes))
        if volumes[best] <= 0.0:
            break
        axis, sign, limit = faces.pop(best)
        pieces.append(beyond[best])
        remaining = half(remaining, axis, -sign, -limit)
    return sorted(pieces, key=lambda part: -_volume(part))


def half(points: np.ndarray, axis: int, sign: float, limit: float) -> np.ndarray:
    """Return the corners (N, 3) of that part of the hull of `points` (M, 3) in which `sign` times the coordinate along
    `axis` is at least `limit` [m]; (0, 3) where that is nothing."""
    height = sign * points[:, axis] - limit
    inside, outside = points[height >= 0.0], points[height < 0.0]
    if not len(inside) or not len(outside):
        return inside
    above, below = height[height >= 0.0], height[height < 0.0]
    share = (above[:, None] / (above[:, None] - below[None]))[..., None]
    crossing = (inside[:, None] + share * (outside[None] - inside[:, None])).reshape(-1, 3)
    return _corners(np.concatenate([inside, crossing]))


def _corners(points: np.ndarray) -> np.ndarray:
    try:
        return points[np.sort(ConvexHull(points).vertices)]
    except (QhullError, ValueError):
        return np.zeros((0, 3))


def _volume(points: np.ndarray) -> float:
    """Volume [m^3] of the hull, 0 for what is thinner than THINNEST along an axis."""
    return hull_volume(points) if len(points) >= 4 and np.ptp(points, axis=0).min() >= THINNEST else 0.0

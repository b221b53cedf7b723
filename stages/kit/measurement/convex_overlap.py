"""How deep two sets of convex pieces lie in each other, and how much space they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

CELLS = 40
"""Cells along each axis of the grid on which shared space is counted."""
SAME_DIRECTION = 1e-6
"""Length of a cross product below which unit directions are called parallel; rounding."""


@dataclass(frozen=True)
class ConvexPiece:
    """A convex polyhedron: its corners, the planes of its faces, the directions of its edges."""

    vertices: np.ndarray
    """(V, 3) [m]."""
    normals: np.ndarray
    """(F, 3) outward unit normals, one a face."""
    offsets: np.ndarray
    """(F,) [m]: inside is normals @ point <= offsets."""
    edges: np.ndarray
    """(E, 3) unit directions, parallel ones once."""

    @property
    def low(self) -> np.ndarray:
        """(3,) least coordinates."""
        return self.vertices.min(axis=0)

    @property
    def high(self) -> np.ndarray:
        """(3,) greatest coordinates."""
        return self.vertices.max(axis=0)

    def placed(self, target_from_source: np.ndarray, scale: float = 1.0) -> ConvexPiece:
        """Return the piece times `scale`, then under a rigid (4, 4) transform."""
        rotation, shift = target_from_source[:3, :3], target_from_source[:3, 3]
        normals = self.normals @ rotation.T
        return ConvexPiece(
            scale * self.vertices @ rotation.T + shift,
            normals,
            scale * self.offsets + normals @ shift,
            self.edges @ rotation.T,
        )


def convex_piece(points: np.ndarray) -> ConvexPiece | None:
    """Return the convex hull of points (N, 3) as a piece, None when they span no volume."""
    try:
        hull = ConvexHull(np.asarray(points, dtype=float))
    except (QhullError, ValueError):
        return None
    normals = hull.equations[:, :3]
    edges = []
    for row, neighbors in enumerate(hull.neighbors):
        for opposite, neighbor in enumerate(neighbors):
            # Triangles of one flat face share a diagonal, which is no edge.
            if neighbor > row and normals[row] @ normals[neighbor] < 1.0 - 1e-9:
                ends = np.delete(hull.simplices[row], opposite)
                edges.append(hull.points[ends[1]] - hull.points[ends[0]])
    faces = np.unique(np.round(hull.equations, 9), axis=0)
    return ConvexPiece(
        hull.points[hull.vertices], faces[:, :3], -faces[:, 3], _without_parallels(np.array(edges).reshape(-1, 3))
    )


def _without_parallels(directions: np.ndarray) -> np.ndarray:
    """Return unit directions (K, 3), of those parallel or opposite only one."""
    length = np.linalg.norm(directions, axis=1)
    unit = directions[length > 1e-12] / length[length > 1e-12, None]
    leading = np.take_along_axis(unit, np.argmax(np.abs(unit) > SAME_DIRECTION, axis=1)[:, None], axis=1)
    unit = unit * np.where(leading < 0, -1.0, 1.0)
    return np.unique(np.round(unit, 9), axis=0)


def piece_depth(a: ConvexPiece, b: ConvexPiece) -> float:
    """Return the shortest way [m] by which one of two convex pieces has to move for them to come apart, else 0.

    Exact: the way leads out through a face of the Minkowski difference, whose normal is that of a face of either
    piece or at right angles to an edge of each (separating axis theorem).
    """
    depth = min(_shallowest(a, b, a.normals), _shallowest(a, b, -b.normals))
    if depth <= 0 or not len(a.edges) or not len(b.edges):
        return max(depth, 0.0)
    crosses = np.cross(a.edges[:, None], b.edges[None]).reshape(-1, 3)
    length = np.linalg.norm(crosses, axis=1)
    crosses = crosses[length > SAME_DIRECTION] / length[length > SAME_DIRECTION, None]
    if not len(crosses):
        return depth
    return max(0.0, min(depth, _shallowest(a, b, crosses), _shallowest(a, b, -crosses)))


def _shallowest(a: ConvexPiece, b: ConvexPiece, axes: np.ndarray) -> float:
    """Least way [m] of `b` along one of the axes (K, 3) that brings it out of `a`; not positive: apart already."""
    return float(((a.vertices @ axes.T).max(axis=0) - (b.vertices @ axes.T).min(axis=0)).min())


def meeting_pieces(a: Sequence[ConvexPiece], b: Sequence[ConvexPiece]) -> list[tuple[int, int]]:
    """Return the pairs (index in a, index in b) of pieces whose axis-aligned boxes share space."""
    if not a or not b:
        return []
    low_a, high_a = np.array([p.low for p in a]), np.array([p.high for p in a])
    low_b, high_b = np.array([p.low for p in b]), np.array([p.high for p in b])
    meet = np.all(low_a[:, None] < high_b[None], axis=2) & np.all(low_b[None] < high_a[:, None], axis=2)
    return [(int(i), int(j)) for i, j in np.argwhere(meet)]


def penetration_depth(a: Sequence[ConvexPiece], b: Sequence[ConvexPiece]) -> float:
    """Return how deep [m] two unions of convex pieces lie in each other: that of the deepest pair, 0 apart."""
    return max((piece_depth(a[i], b[j]) for i, j in meeting_pieces(a, b)), default=0.0)


def shared_volume(a: Sequence[ConvexPiece], b: Sequence[ConvexPiece], cells: int = CELLS) -> float:
    """Return the volume [m^3] that two unions of convex pieces share, counted on a grid.

    The grid of `cells`^3 cells spans the box of all meeting pairs of pieces; a cell counts when its middle is inside a
    piece of each. Exact where that box is what they share; else the error is about a layer of half a cell.
    """
    pairs = [(i, j) for i, j in meeting_pieces(a, b) if piece_depth(a[i], b[j]) > 0]
    if not pairs:
        return 0.0
    low = np.min([np.maximum(a[i].low, b[j].low) for i, j in pairs], axis=0)
    high = np.max([np.minimum(a[i].high, b[j].high) for i, j in pairs], axis=0)
    step = (high - low) / cells
    axes = [low[k] + (np.arange(cells) + 0.5) * step[k] for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    inside_a = _inside_any([a[i] for i in sorted({i for i, _ in pairs})], points)
    points = points[inside_a]
    inside_b = _inside_any([b[j] for j in sorted({j for _, j in pairs})], points)
    return float(inside_b.sum() * step.prod())


def _inside_any(pieces: Sequence[ConvexPiece], points: np.ndarray) -> np.ndarray:
    inside = np.zeros(len(points), dtype=bool)
    for piece in pieces:
        in_box = np.nonzero(~inside & np.all((points >= piece.low) & (points <= piece.high), axis=1))[0]
        inside[in_box] = np.all(points[in_box] @ piece.normals.T <= piece.offsets, axis=1)
    return inside

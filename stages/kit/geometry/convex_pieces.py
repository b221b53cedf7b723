"""A mesh as a few convex pieces: the set of its triangles is halved where the hulls of the halves are smallest.

For scans, which are open and have no inside: what is compared are convex hulls of surfaces, never volumes of meshes.
"""

from __future__ import annotations

from hashlib import sha256

import numpy as np
from scipy.spatial import ConvexHull, QhullError

MOST_PIECES = 8
"""Most convex pieces of a mesh unless more are asked for; by eye."""
GAIN = 0.12
"""A cut must save this share of the volume of the hull that it cuts."""
PLACES = (0.15, 0.25, 0.35, 0.5, 0.65, 0.75, 0.85)
"""Shares of the extent along an axis at which cuts are tried; by eye."""
LEAST_TRIANGLES = 8
"""Fewest triangles on either side of a cut; by eye."""
MOST_TRIANGLES = 20_000
"""Most triangles that cuts are judged by; larger meshes are thinned."""
MESHES_KEPT = 64
"""Meshes whose pieces are kept: a scene is written several times with the same ones."""
_kept: dict[tuple[bytes, int], list[np.ndarray]] = {}
"""Digest of a mesh and most pieces -> numbers of the triangles of each piece; the last asked for last."""


def convex_pieces(vertices: np.ndarray, faces: np.ndarray, most: int = MOST_PIECES) -> list[np.ndarray]:
    """Return the corner points (N, 3) of each piece, at most `most`; all points of the mesh are in some piece.

    `vertices` (V, 3) [m], `faces` (F, 3). Every how many-th triangle of a large mesh decides where to cut. A mesh that
    was asked before is not cut again.
    """
    vertices, faces = np.ascontiguousarray(vertices, dtype=float), np.ascontiguousarray(faces, dtype=np.int64)
    asked = sha256(vertices.tobytes() + faces.tobytes()).digest(), most
    groups = _kept.pop(asked, None)
    _kept[asked] = groups = _groups(vertices, faces, most) if groups is None else groups
    if len(_kept) > MESHES_KEPT:
        del _kept[next(iter(_kept))]
    return [np.unique(vertices[faces[group]].reshape(-1, 3), axis=0) for group in groups]


def _groups(vertices: np.ndarray, faces: np.ndarray, most: int) -> list[np.ndarray]:
    """Return the numbers of the triangles of each piece."""
    groups = [np.arange(len(faces))]
    cuts = [_best_cut(vertices, faces)]
    while len(groups) < most:
        best = int(np.argmax([0.0 if cut is None else cut[0] for cut in cuts]))
        cut = cuts[best]
        if cut is None:
            break
        halves = [groups[best][cut[1]], groups[best][~cut[1]]]
        groups[best : best + 1] = halves
        cuts[best : best + 1] = [_best_cut(vertices, faces[half]) for half in halves]
    return groups


def _best_cut(vertices: np.ndarray, faces: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Return the volume [m^3] that the best cut of triangles (F, 3) saves and the one side (F,); None without any that
    is worth it."""
    if len(faces) < 2 * LEAST_TRIANGLES:
        return None
    sample = faces[:: max(1, len(faces) // MOST_TRIANGLES)]
    volume = hull_volume(corners_of(vertices, sample))
    best: tuple[float, np.ndarray] | None = None
    middles, middles_of_few = vertices[faces].mean(axis=1), vertices[sample].mean(axis=1)
    for axis in _axes(vertices[sample]):
        along, along_few = middles @ axis, middles_of_few @ axis
        low, high = along_few.min(), along_few.max()
        for share in PLACES:
            limit = low + share * (high - low)
            side = along_few < limit
            if min(side.sum(), (~side).sum()) < LEAST_TRIANGLES:
                continue
            saved = volume - sum(hull_volume(corners_of(vertices, sample[half])) for half in (side, ~side))
            if saved > GAIN * volume and (best is None or saved > best[0]):
                best = (saved, along < limit)
    return best


def corners_of(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the vertices (N, 3) of triangles (F, 3), each once."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    return vertices[used]


def _axes(corners: np.ndarray) -> np.ndarray:
    """Return upright and the two level principal axes, as rows."""
    level = corners.reshape(-1, 3)[:, :2]
    level = level - level.mean(axis=0)
    turned = np.linalg.eigh(level.T @ level)[1]
    return np.array([[0.0, 0.0, 1.0], [*turned[:, 0], 0.0], [*turned[:, 1], 0.0]])


def hull_volume(points: np.ndarray) -> float:
    """Return the volume [m^3] of the convex hull of points (N, 3) [m]; 0 where they are flat."""
    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0  # flat

"""Surface that no mask named, cut into pieces: what stands free in a room is a thing, whatever it is.

Ours; the thesis leaves unnamed surface out of its entities. A detector names what it was taught; the counter, the crate
and the chair whose back alone was seen are there all the same, and a robot must not drive into them.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from stages.kit.geometry.point_clouds import vertex_normals

LEVEL, UPRIGHT = 0.9, 0.25
"""Cosines to the vertical: what faces up has more, what stands upright less."""
WALL_SEEN_BELOW, WALL_SEEN_ABOVE = 1.0, 1.95
"""A wall is a plane that is seen below and above these heights [m]: fridges end between them."""
COLUMN, COLUMN_AREA = 0.15, 0.01
"""Width [m] of the columns that walls are made of, and what of one has to be seen low, and high [m^2]."""
OPENING = 1.2
"""Wider gaps between columns end a wall [m]."""
WALL_DEPTH, BEHIND = 0.12, 4
"""What lies no farther before a wall belongs to it: frames, switches, radiators [m]; and so many times that behind."""
DIRECTIONS = 72
"""Of walls."""
CEILING = 2.2
"""Pieces that begin higher are of the ceiling [m]."""
FLOOR = 0.06
"""Surface this low is of the floor [m]."""
LOWEST_TOP, LEAST_TOP_AREA = 0.6, 0.25
"""Height [m] and area [m^2] of a level top on which other things stand; seats are lower."""
SAME_LEVEL = 0.03
"""[m]"""
STACKED_SHARE, STACKED_GAP = 0.5, 0.35
"""Pieces above each other with this share of the smaller footprint in common, and this gap at most [m], are one."""
FEWEST_JOINED = 50
"""Vertices of a part that is joined with others."""
SCRAP_SHARE, SCRAP_DISTANCE = 0.25, 0.1
"""A part smaller than this share of another, and this close to it [m], is a scrap of it."""
WITHIN, BESIDE = 0.6, 0.1
"""A piece is left to the named thing under or over which this share of it lies, or as far beside it [m]."""
TOP = 0.75
"""Quantile of a thing's heights that counts as its top: some of what stands on it may have been named with it."""
SMALLEST, LEAST_HEIGHT = 0.1, 0.06
"""Extents of a piece [m]."""


def unnamed_pieces(
    vertices: np.ndarray,
    faces: np.ndarray,
    instance: np.ndarray,
    layout: np.ndarray,
    *,
    voxel: float,
    minimum_area: float,
) -> np.ndarray:
    """Return the piece of every vertex (V,), from 1 in the order of size; 0 for what is named or of the room itself.

    vertices (V, 3) [m], z up, the floor at 0; faces (F, 3); instance (V,), 0 where no mask named the surface; layout
    (V,): what masks named floor, wall or ceiling; `voxel` [m]. Left out is what has less than `minimum_area` [m^2], and
    what lies within the outline of a named thing and begins below its top: a leg, or a leaf that its mask missed.
    """
    piece = np.zeros(len(vertices), np.int32)
    if not len(faces):
        return piece
    normals = vertex_normals(vertices, faces)
    free = (instance == 0) & (vertices[:, 2] > FLOOR)
    members = np.flatnonzero(free & ~of_walls(vertices, normals, free | layout, voxel))
    points = vertices[members]
    parts = _cut_above_tops(points, normals[members], _components(points, voxel), voxel)
    named = [vertices[instance == name] for name in np.unique(instance[(instance > 0) & ~layout])]
    alone = ~_of_named(points, parts, named)
    members, points, parts = members[alone], points[alone], parts[alone]
    parts = _joined(points, normals[members], parts, voxel)
    kept = []
    for part in np.unique(parts):
        own = members[parts == part]
        low, high = vertices[own].min(axis=0), vertices[own].max(axis=0)
        large = len(own) * voxel**2 >= minimum_area and (high - low)[:2].max() >= SMALLEST
        if large and high[2] - low[2] >= LEAST_HEIGHT and low[2] < CEILING:
            kept.append(own)
    for number, own in enumerate(sorted(kept, key=lambda own: (-len(own), own[0])), 1):
        piece[own] = number
    return piece


def of_walls(vertices: np.ndarray, normals: np.ndarray, candidates: np.ndarray, voxel: float) -> np.ndarray:
    """Return which of the `candidates` (V,) lie on, shortly before, or behind a wall.

    A wall is made of upright columns, each of which was seen both low and high on one plane; gaps between them that are
    no wider than a door (what hides a wall, and openings) belong to it.
    """
    upright = np.flatnonzero(candidates & (np.abs(normals[:, 2]) < UPRIGHT))
    angle = np.arctan2(normals[upright, 1], normals[upright, 0])
    found = np.zeros(len(vertices), bool)
    fewest = COLUMN_AREA / voxel**2
    for theta in np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS:
        axis, along = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
        facing = upright[np.cos(angle - theta) > np.cos(2 * np.pi / DIRECTIONS)]
        place = np.floor(vertices[:, :2] @ axis / WALL_DEPTH).astype(int)
        column = np.floor(vertices[:, :2] @ along / COLUMN).astype(int)
        height = vertices[facing, 2]
        keys, inverse = np.unique(np.stack([place[facing], column[facing]], 1), axis=0, return_inverse=True)
        low = np.bincount(inverse, height < WALL_SEEN_BELOW, len(keys))
        high = np.bincount(inverse, height > WALL_SEEN_ABOVE, len(keys))
        keys = keys[(low > fewest) & (high > fewest)]
        for number in np.unique(keys[:, 0]):
            seen = np.sort(keys[keys[:, 0] == number, 1])
            gaps = [np.arange(a, b) for a, b in zip(seen[:-1], seen[1:], strict=True) if (b - a) * COLUMN < OPENING]
            span = np.concatenate([seen, *gaps])
            near = (place <= number + 1) & (place >= number - BEHIND)
            found |= near & np.isin(column, np.concatenate([span - 1, span, span + 1]))
    return found & candidates


def _components(points: np.ndarray, voxel: float) -> np.ndarray:
    """Return the connected part (N,) of points that are at most two voxels apart."""
    if not len(points):
        return np.zeros(0, int)
    pairs = cKDTree(points).query_pairs(2.0 * voxel, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    return connected_components(graph, directed=False)[1]


def _cut_above_tops(points: np.ndarray, normals: np.ndarray, parts: np.ndarray, voxel: float) -> np.ndarray:
    """Cut what stands on the largest level top of each part from it."""
    result, after = parts.copy(), int(parts.max(initial=0)) + 1
    for part in np.unique(parts):
        own = np.flatnonzero(parts == part)
        up = own[(normals[own, 2] > LEVEL) & (points[own, 2] > LOWEST_TOP)]
        if len(up) * voxel**2 < LEAST_TOP_AREA:
            continue
        levels, counts = np.unique(np.round(points[up, 2] / SAME_LEVEL).astype(int), return_counts=True)
        best = int(np.argmax(counts))
        if counts[best] * voxel**2 < LEAST_TOP_AREA:
            continue
        above = own[points[own, 2] > levels[best] * SAME_LEVEL + 1.5 * SAME_LEVEL]
        if len(above):
            result[above] = after + _components(points[above], voxel)
            after = int(result.max()) + 1
    return result


def _cells(points: np.ndarray, voxel: float) -> np.ndarray:
    """Return the cells (C,) of a grid of two voxels over which points (N, 3) lie, each once, sorted."""
    cells = np.floor(points[:, :2] / (2 * voxel)).astype(np.int64)
    return np.unique(cells[:, 0] * 2**31 + cells[:, 1])


def _common(first: np.ndarray, second: np.ndarray) -> float:
    """Return the share of the cells of `first` that are of `second` too."""
    return len(np.intersect1d(first, second, assume_unique=True)) / len(first)


def _of_named(points: np.ndarray, parts: np.ndarray, named: list[np.ndarray]) -> np.ndarray:
    """Return which points (N,) are of parts that lie over or under a named thing (M, 3) and begin below its top."""
    result = np.zeros(len(points), bool)
    for thing in named:
        beside = cKDTree(thing[:, :2]).query(points[:, :2], distance_upper_bound=BESIDE)[0] < BESIDE
        top = float(np.quantile(thing[:, 2], TOP))
        for part in np.unique(parts[beside]):
            own = parts == part
            result |= own & bool(points[own, 2].min() < top - SAME_LEVEL and beside[own].mean() >= WITHIN)
    return result


def _joined(points: np.ndarray, normals: np.ndarray, parts: np.ndarray, voxel: float) -> np.ndarray:
    """Join each part with the closest larger one between which and it the surface was not seen: above or below it, or a
    scrap beside it.

    What stands on a level top stays apart from what has it.
    """
    result = parts.copy()
    names, sizes = np.unique(parts, return_counts=True)
    names = names[sizes >= FEWEST_JOINED]
    own = {name: np.flatnonzero(parts == name) for name in names}
    cells = {name: _cells(points[own[name]], voxel) for name in names}
    trees = {name: cKDTree(points[own[name]]) for name in names}
    low = {name: points[own[name], 2].min() for name in names}
    high = {name: points[own[name], 2].max() for name in names}
    topped = {name: _level_area(points[own[name]], normals[own[name]], voxel) >= LEAST_TOP_AREA for name in names}

    for small in names.tolist():
        near: list[tuple[float, int]] = []
        for large in names.tolist():
            below, above = (small, large) if (low[small], small) < (low[large], large) else (large, small)
            on_top = topped[below] and low[above] > high[below] - SAME_LEVEL
            if (len(own[large]), large) <= (len(own[small]), small) or on_top:
                continue
            gap = float(trees[large].query(points[own[small]], distance_upper_bound=STACKED_GAP)[0].min())
            stacked = _common(cells[small], cells[large]) >= STACKED_SHARE and gap < STACKED_GAP
            if stacked or (gap < SCRAP_DISTANCE and len(own[small]) < SCRAP_SHARE * len(own[large])):
                near.append((gap, large))
        if near:
            kept, gone = sorted((result[own[small][0]], result[own[min(near)[1]][0]]))
            result[result == gone] = kept
    return result


def _level_area(points: np.ndarray, normals: np.ndarray, voxel: float) -> float:
    """Return the area [m^2] of the upward surface (N, 3) that lies at the most frequent height of it."""
    levels = np.round(points[normals[:, 2] > LEVEL, 2] / SAME_LEVEL).astype(int)
    return float(np.unique(levels, return_counts=True)[1].max(initial=0)) * voxel**2

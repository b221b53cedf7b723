"""Surface that no mask named, cut into pieces: what stands free in a room is a thing, whatever it is.

Ours; the thesis leaves unnamed surface out of its entities. A detector names what it was taught; the counter, the crate
and the chair whose back alone was seen are there all the same, and a robot must not drive into them. Where masks are
not to be relied on they propose parts, and geometry says what becomes of them.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

LEVEL = 0.9
"""Cosine to the vertical that what faces up has at least."""
CEILING = 2.2
"""Pieces that begin higher are of the ceiling [m]."""
FLOOR = 0.06
"""Surface this low is of the floor [m]."""
LOWEST_TOP, LEAST_TOP_AREA = 0.6, 0.25
"""Height [m] and area [m^2] of a level top on which other things stand; seats are lower."""
SAME_LEVEL = 0.03
"""Largest difference in height of points on one level [m]."""
RISE = 1.5 * SAME_LEVEL
"""Height over a level top from which on nothing is part of it [m]; nor is what bends away from it by a voxel."""
APRON = 0.15
"""Depth under a thing's top from which on what hangs together with it is its body [m]."""
SHADOW = 0.15
"""Gaps in a level top this wide are of it: what stands there hides it [m]."""
STACKED_SHARE, STACKED_GAP = 0.5, 0.35
"""Pieces above each other with this share of the smaller footprint in common, and this gap at most [m], are one."""
TOLD = 0.75
"""Share of a piece's views in a table's masks from which on it is of the table whatever its shape. A detector's masks
took along what stands at tables in at most half of the views, true ones a desk's own shelf in nearly all."""
LEAST_RISE = 0.75
"""Height over a level top, in voxels, from which on points are of what lies on it; the highest quarter of that is a
voxel over it."""
BENDING_STEPS = 5
"""Times the bending of a top is fitted anew without its outliers; by eye."""
FEWEST = 50
"""Vertices of a part that is looked at, and of a thing on a level top."""
SCRAP_SHARE, SCRAP_DISTANCE = 0.25, 0.1
"""A part that is no piece by itself, smaller than this share of another and this close to it [m], is a scrap of it."""
WITHIN, BESIDE = 0.6, 0.1
"""A piece is left to the named thing under or over which this share of it lies, or as far beside it [m]."""
TOP = 0.75
"""Quantile of a thing's heights that counts as its top: some of what stands on it may have been named with it."""
SMALLEST, LEAST_HEIGHT = 0.1, 0.06
"""Extents of a piece [m]."""
NO_PART = -1
"""Part of vertices that are in none."""


def unnamed_pieces(
    vertices: np.ndarray,
    normals: np.ndarray,
    instance: np.ndarray,
    room: np.ndarray,
    *,
    voxel: float,
    minimum_area: float,
    proposed: np.ndarray | None = None,
    sure: Collection[int] = (),
    topped: Collection[int] = (),
    tables: Collection[int] = (),
    told: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the piece of every vertex (V,), from 1 in the order of size, 0 for what is named or of the room itself;
    and the instance (V,) of the named thing that every vertex is of, 0 for pieces.

    vertices (V, 3) [m], z up, the floor at 0; normals (V, 3); instance (V,), 0 where no mask named the surface; `room`
    (V,): floor, walls and ceiling; `proposed` (V,): what doubtful masks took for one thing each, 0 for none; `sure`:
    which of these are not cut at their tops; `voxel` [m]; `topped`: instances of which what rises over a level top is a
    piece, whether their mask took it with them or not, unless most of its views say that it is of the thing: `told`
    (V,), 0..1, by default 0. Left out is what has less than `minimum_area` [m^2] and neither stands on a level top nor
    was proposed, and what lies within the outline of a named thing and begins below its top: a leg, or a leaf that its
    mask missed, which is of the thing where it touches it. Under `tables` are legs of chairs too: they stay unnamed.
    """
    piece = np.zeros(len(vertices), np.int32)
    members = np.flatnonzero((instance == 0) & ~room & (vertices[:, 2] > FLOOR))
    points = vertices[members]
    components = _components(points, voxel, None if proposed is None else proposed[members])
    proposed_parts = set() if proposed is None else set(components[proposed[members] > 0].tolist())
    kept_whole = set() if proposed is None else set(components[np.isin(proposed[members], sorted(sure))].tolist())
    components, standing = _cut_at_tops(points, normals[members], components, voxel, kept_whole)
    names, part_of, freed = np.where(room, 0, instance), np.full(len(vertices), NO_PART), set()
    part_of[members] = components
    told = np.zeros(len(vertices)) if told is None else told
    for thing in sorted(set(topped) & set(np.unique(names).tolist())):
        own, on_top = _cut_from_named(vertices, normals, names, part_of, told, thing, voxel)
        freed |= own
        standing |= on_top
    members = np.flatnonzero(part_of != NO_PART)
    points, components = vertices[members], part_of[members]
    for _, top in _tops(vertices, normals, names, voxel):
        if names[top[0]] > 0:
            level, footprint = float(np.median(vertices[top, 2])), _Footprint(vertices[top, :2], voxel)
            standing |= _parts_standing_on(level, footprint, points, components)
    alone, of_named = np.ones(len(points), bool), instance.astype(np.int32)
    for name in np.unique(names[names > 0]).tolist():
        thing = vertices[names == name]
        of_thing = alone & _of_named(points, components, thing) & ~np.isin(components, sorted(freed))
        alone &= ~of_thing
        if name not in tables:
            of_named[members[_points_touching(points, np.where(of_thing, components, NO_PART), thing, voxel)]] = name
    members, points, components = members[alone], points[alone], components[alone]
    components = _join_parts(points, normals[members], components, standing, proposed_parts, voxel, minimum_area)
    pieces = []
    for part in np.unique(components):
        own = members[components == part]
        extent = np.ptp(vertices[own], axis=0)
        large = len(own) * voxel**2 >= minimum_area and extent[:2].max() >= SMALLEST
        high = extent[2] >= LEAST_HEIGHT and vertices[own, 2].min() < CEILING
        if (large and high) or (len(own) >= FEWEST and part in standing | proposed_parts):
            pieces.append(own)
    for number, own in enumerate(sorted(pieces, key=lambda own: (-len(own), own[0])), 1):
        piece[own] = number
    return piece, np.where(piece > 0, 0, of_named).astype(np.int32)


def _components(points: np.ndarray, voxel: float, proposed: np.ndarray | None = None) -> np.ndarray:
    """Return the connected part (N,) of points that are at most two voxels apart; what is `proposed` (N,) is a part."""
    if not len(points):
        return np.zeros(0, int)
    pairs = cKDTree(points).query_pairs(2.0 * voxel, output_type="ndarray")
    if proposed is not None:
        pairs = pairs[(proposed[pairs] == 0).all(axis=1)]
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    components = connected_components(graph, directed=False)[1]
    if proposed is None:
        return components
    return np.where(proposed > 0, len(points) + proposed, components)


class _Footprint:
    """Where a level top lies, seen from above: its points (N, 2) and what they surround."""

    def __init__(self, points: np.ndarray, voxel: float) -> None:
        self.cell = 2 * voxel
        reach = round(SHADOW / self.cell)
        cells = np.floor(points / self.cell).astype(int)
        self.corner = cells.min(axis=0) - reach - 1
        grid = np.zeros(cells.max(axis=0) - self.corner + reach + 2, bool)
        grid[tuple((cells - self.corner).T)] = True
        steps = np.arange(-reach, reach + 1)
        disc = steps[:, None] ** 2 + steps[None] ** 2 <= reach**2
        self.grid = ndimage.binary_fill_holes(ndimage.binary_closing(grid, disc))

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Return which points (N, 2 or more) lie above, on or below it."""
        cells = np.floor(points[:, :2] / self.cell).astype(int) - self.corner
        inside = ((cells >= 0) & (cells < self.grid.shape)).all(axis=1)
        result = np.zeros(len(points), bool)
        result[inside] = self.grid[tuple(cells[inside].T)]
        return result


def _tops(
    points: np.ndarray, normals: np.ndarray, components: np.ndarray, voxel: float
) -> list[tuple[int, np.ndarray]]:
    """Return the level tops of all parts, the largest first: the part, and the numbers of the points."""
    tops = []
    for part in np.unique(components):
        up = np.flatnonzero((components == part) & (normals[:, 2] > LEVEL) & (points[:, 2] > LOWEST_TOP))
        if len(up) * voxel**2 < LEAST_TOP_AREA:
            continue
        patch = _components(points[up] * [1.0, 1.0, 2.0], voxel)  # a step of more than a voxel parts two levels
        for number in np.flatnonzero(np.bincount(patch) * voxel**2 >= LEAST_TOP_AREA):
            tops.append((int(part), up[patch == number]))
    return sorted(tops, key=lambda top: (-len(top[1]), top[1][0]))


def topped_parts(points: np.ndarray, normals: np.ndarray, voxel: float) -> np.ndarray:
    """Return which of points (N, 3), the floor at 0, are of a connected part with a level top on which things stand."""
    components = _components(points, voxel)
    return np.isin(components, [part for part, _ in _tops(points, normals, components, voxel)])


def _cut_at_tops(
    points: np.ndarray, normals: np.ndarray, components: np.ndarray, voxel: float, kept_whole: Collection[int] = ()
) -> tuple[np.ndarray, set[int]]:
    """Cut what stands on the level tops of each part from it, and what rises beside them: a chair, a tall cabinet.

    Return the parts (N,), and which of them stand on a top. Nothing is cut from those that are `kept_whole`.
    """
    result, standing = components.copy(), set()
    after = int(components.max(initial=0)) + 1
    for part, top in _tops(points, normals, components, voxel):
        level, footprint = float(np.median(points[top, 2])), _Footprint(points[top, :2], voxel)
        if part in kept_whole:
            standing |= _parts_standing_on(level, footprint, points, result) - {part}
            continue
        of_part = np.flatnonzero(result == part)
        over, inside = points[of_part, 2] - level, footprint.holds(points[of_part])
        rise = _over_top(points[of_part], points[top], voxel)
        risen = inside & (rise > LEAST_RISE * voxel)
        above, rise = of_part[risen], rise[risen]
        component = _components(points[above], voxel)
        for number in np.flatnonzero(np.bincount(component, minlength=1) >= FEWEST):
            thing = above[component == number]
            if np.quantile(rise[component == number], TOP) > voxel:
                result[thing] = after
                standing.add(after)
                after += 1
        of_part = of_part[result[of_part] == part]
        over, inside = points[of_part, 2] - level, footprint.holds(points[of_part])
        body = ~inside | (np.abs(over) > RISE)
        of_part, over, inside = of_part[body], over[body], inside[body]
        component = _components(points[of_part], voxel)
        rising = (over > RISE) & ~inside
        under = inside & (over > -APRON) & (over < -RISE)
        for number in np.flatnonzero(np.bincount(component[rising], minlength=1) >= FEWEST):
            beside = component == number
            if (beside & under).sum() >= FEWEST:  # the two hang together: cut straight down
                beside &= ~inside & _Footprint(points[of_part[beside & rising], :2], voxel).holds(points[of_part])
            result[of_part[beside]] = after
            after += 1
        standing |= _parts_standing_on(level, footprint, points, result)
    return result, standing


def _over_top(points: np.ndarray, top: np.ndarray, voxel: float) -> np.ndarray:
    """Return how high points (N, 3) are over a level top (M, 3) that may be bent, and may have some of what lies on it
    among its points [m]: over the quadric of most of them."""
    middle, level = np.median(top[:, :2], axis=0), float(np.median(top[:, 2]))

    def terms(ground: np.ndarray) -> np.ndarray:
        x, y = (ground - middle).T
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)

    columns, height = terms(top[:, :2]), top[:, 2] - level
    inliers = np.abs(height) < 2 * voxel
    for _ in range(BENDING_STEPS):
        shape = np.linalg.lstsq(columns[inliers], height[inliers], rcond=None)[0]
        inliers = np.abs(height - columns @ shape) < voxel / 2
    return points[:, 2] - level - terms(points[:, :2]) @ shape


def _cut_from_named(
    vertices: np.ndarray,
    normals: np.ndarray,
    names: np.ndarray,
    part_of: np.ndarray,
    name_scores: np.ndarray,
    name: int,
    voxel: float,
) -> tuple[set[int], set[int]]:
    """Make parts, in place, of what rises over the top of a named thing, whether its mask took it along or nobody named
    it: `names` (V,) has 0 there then, `part_of` (V,) new parts. Return these, and those of them that stand on the top.
    A shelf over a desk, which most views `told` (V,) to be of it, is of it.
    """
    members = np.flatnonzero(part_of != NO_PART)
    loose = members[_of_named(vertices[members], part_of[members], vertices[names == name])]
    around = np.concatenate([np.flatnonzero(names == name), loose])
    cut, on_top = _cut_at_tops(vertices[around], normals[around], np.zeros(len(around), int), voxel)
    mean = np.bincount(cut, weights=name_scores[around]) / np.maximum(np.bincount(cut), 1)
    cut[mean[cut] >= TOLD] = 0
    first, rising = 1 + int(part_of.max(initial=0)), around[cut > 0]
    part_of[rising], names[rising] = first + cut[cut > 0], 0
    return set(part_of[rising].tolist()), {first + part for part in on_top if part}


def _parts_standing_on(level: float, footprint: _Footprint, points: np.ndarray, components: np.ndarray) -> set[int]:
    """Return the parts that begin on a level top and lie over it."""
    standing = set()
    for part in np.unique(components[(points[:, 2] > level) & footprint.holds(points)]):
        part_points = points[components == part]
        if part_points[:, 2].min() > level - RISE and footprint.holds(part_points).mean() > 0.5:
            standing.add(int(part))
    return standing


def _cells(points: np.ndarray, voxel: float) -> np.ndarray:
    """Return the cells (C,) of a grid of two voxels over which points (N, 3) lie, each once, sorted."""
    cells = np.floor(points[:, :2] / (2 * voxel)).astype(np.int64)
    return np.unique(cells[:, 0] * 2**31 + cells[:, 1])


def _common(first: np.ndarray, second: np.ndarray) -> float:
    """Return the share of the cells of `first` that are of `second` too."""
    return len(np.intersect1d(first, second, assume_unique=True)) / len(first)


def _of_named(points: np.ndarray, components: np.ndarray, thing: np.ndarray) -> np.ndarray:
    """Return which points (N,) are of parts that lie over or under a named thing (M, 3) and begin below its top."""
    result = np.zeros(len(points), bool)
    beside = cKDTree(thing[:, :2]).query(points[:, :2], distance_upper_bound=BESIDE)[0] < BESIDE
    top = float(np.quantile(thing[:, 2], TOP))
    for part in np.unique(components[beside]):
        of_part = components == part
        result |= of_part & bool(points[of_part, 2].min() < top - SAME_LEVEL and beside[of_part].mean() >= WITHIN)
    return result


def _points_touching(points: np.ndarray, components: np.ndarray, thing: np.ndarray, voxel: float) -> np.ndarray:
    """Return which points (N,) are of parts that touch a thing (M, 3) and are smaller than it."""
    of_part = np.flatnonzero(components != NO_PART)
    touching = of_part[cKDTree(thing).query(points[of_part], distance_upper_bound=2.0 * voxel)[0] < 2.0 * voxel]
    names, sizes = np.unique(components[of_part], return_counts=True)
    return np.isin(components, np.intersect1d(components[touching], names[sizes < len(thing)]))


def _join_parts(
    points: np.ndarray,
    normals: np.ndarray,
    components: np.ndarray,
    standing: set[int],
    proposed_parts: set[int],
    voxel: float,
    minimum_area: float,
) -> np.ndarray:
    """Join each part with the closest larger one between which and it the surface was not seen: above or below it, or a
    scrap beside it, which is smaller than `minimum_area` [m^2].

    What stands on a level top (`standing`) stays apart from what has it.
    """
    result = components.copy()
    names, sizes = np.unique(components, return_counts=True)
    names = np.array([name for name in names[sizes >= FEWEST] if name not in standing], int)
    points_of = {name: np.flatnonzero(components == name) for name in names}
    cells = {name: _cells(points[points_of[name]], voxel) for name in names}
    trees = {name: cKDTree(points[points_of[name]]) for name in names}
    low = {name: points[points_of[name], 2].min() for name in names}
    top = {name: _top_height(points[points_of[name]], normals[points_of[name]], voxel) for name in names}

    for small in names.tolist():
        neighbours: list[tuple[float, int]] = []
        for large in names.tolist():
            below, above = (small, large) if (low[small], small) < (low[large], large) else (large, small)
            on_top = low[above] > top[below] - SAME_LEVEL
            if (len(points_of[large]), large) <= (len(points_of[small]), small) or on_top:
                continue
            gap = float(trees[large].query(points[points_of[small]], distance_upper_bound=STACKED_GAP)[0].min())
            stacked = _common(cells[small], cells[large]) >= STACKED_SHARE and gap < STACKED_GAP
            scrap = len(points_of[small]) < min(SCRAP_SHARE * len(points_of[large]), minimum_area / voxel**2)
            if stacked or (scrap and gap < SCRAP_DISTANCE and small not in proposed_parts):
                neighbours.append((gap, large))
        if neighbours:
            lower, gone = sorted((result[points_of[small][0]], result[points_of[min(neighbours)[1]][0]]))
            result[result == gone] = lower
    return result


def _top_height(points: np.ndarray, normals: np.ndarray, voxel: float) -> float:
    """Return the height [m] at which most of the upward surface (N, 3) lies; infinite where it is no level top."""
    levels, counts = np.unique(np.round(points[normals[:, 2] > LEVEL, 2] / SAME_LEVEL), return_counts=True)
    if counts.max(initial=0) * voxel**2 < LEAST_TOP_AREA:
        return np.inf
    return float(levels[counts.argmax()]) * SAME_LEVEL

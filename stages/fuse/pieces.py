"""Surface that no mask names, cut by geometry into few pieces: what stands free in a room is a thing, whatever it is.

Ours; the thesis leaves unnamed surface out of its entities. A part ends where it stands on a level top that is larger
than its foot, and beside a top over which it rises. What stands along the rim of a top, over half of its length, is a
back or an arm, and belongs to it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scenewright.stages.fuse.connecting import connected
from scenewright.stages.fuse.ground_index import GroundIndex
from scipy import ndimage
from scipy.spatial import cKDTree

LEVEL = 0.9
"""Cosine to the vertical that what faces up has at least."""
LOWEST_TOP, LEAST_TOP_AREA = 0.25, 0.08
"""Height over the floor [m] and area [m^2] of a level top on which other things stand."""
RISE = 0.045
"""Height over a level top from which on nothing is part of it [m]."""
APRON = 0.15
"""Depth under a top from which on what hangs together with it is its body [m]."""
SHADOW = 0.15
"""Gaps in a level top this wide are of it: what stands there hides it [m]."""
RIM, ALONG = 0.4, 0.5
"""What stands within this share of a top's width of its rim, over this share of its length, is a back or an arm of
it."""
TOP_SHARE = 0.1
"""A top that is a smaller share of its part parts nothing from it but what stands on it."""
BACK, SEAT, THICK = 0.1, 0.55, 0.3
"""A side or a back rises so close beside a top [m]; beside a seat, which is lower, so close with its cushions."""
ON_RIM = 0.8
"""Share of a foot that lies on the rim then."""
LEAST_RISE = 0.75
"""Height over a level top, in voxels, from which on points are of what lies on it; the highest quarter of that is a
voxel over it."""
BENDING_STEPS = 5
"""Times the bending of a top is fitted anew without its outliers."""
SMALL = 0.02
"""Area of a part that is looked at, and of a thing on a level top [m^2]."""
STACKED_SHARE, STACKED_GAP = 0.5, 0.35
"""Parts above each other with this share of the smaller footprint in common, and this gap at most [m], are one."""
SCRAP_SHARE, SCRAP_DISTANCE = 0.25, 0.1
"""A part that is no piece by itself, smaller than this share of another and this close to it [m], is a scrap of it."""
HIGHEST = 2.2
"""Pieces that begin higher over the floor are lamps or of the ceiling [m]."""
SMALLEST, LEAST_HEIGHT = 0.1, 0.06
"""Extents of a piece [m]."""


@dataclass(frozen=True)
class Cloud:
    """A surface: vertices (V, 3) [m], z up, the floor at 0; normals (V, 3); `voxel` [m], a vertex stands for one."""

    vertices: np.ndarray
    normals: np.ndarray
    voxel: float

    @property
    def fewest(self) -> int:
        """Vertices that stand for SMALL."""
        return round(SMALL / self.voxel**2)


@dataclass(frozen=True)
class _Top:
    part: int
    members: np.ndarray
    """Numbers of the vertices."""
    level: float
    footprint: Footprint


@dataclass(frozen=True)
class Pieces:
    """Pieces of a surface (V,)."""

    piece: np.ndarray
    """(V,) int32: from 1 in the order of size, 0 of no piece."""
    thing_of: np.ndarray
    """(V,) int32: the thing of masks that each other vertex is of, 0 none."""


class Footprint:
    """Where a level top lies, seen from above: its points (N, 2) and what they surround."""

    def __init__(self, points: np.ndarray, voxel: float) -> None:
        self.cell = 2 * voxel
        reach = round(SHADOW / self.cell)
        cells = np.floor(points / self.cell).astype(int)
        self.corner = cells.min(axis=0) - reach - 1
        grid = np.zeros(cells.max(axis=0) - self.corner + reach + 2, bool)
        grid[tuple((cells - self.corner).T)] = True
        self.grid = ndimage.binary_fill_holes(ndimage.binary_closing(grid, _disc(reach)))
        self._depth = ndimage.distance_transform_edt(self.grid) - ndimage.distance_transform_edt(~self.grid)
        self.width = 2.0 * self.cell * float(self._depth.max())
        """Of the widest place [m]."""

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Two corners (2,) of the ground around it [m]."""
        return self.corner * self.cell, (self.corner + self.grid.shape) * self.cell

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Return which points (N, 2 or more) lie above, on or below it."""
        cells = np.floor(points[:, :2] / self.cell).astype(int) - self.corner
        inside = ((cells >= 0) & (cells < self.grid.shape)).all(axis=1)
        result = np.zeros(len(points), bool)
        result[inside] = self.grid[tuple(cells[inside].T)]
        return result

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (N, 2 or more) are within the rim [m], negative outside."""
        cells = np.floor(points[:, :2] / self.cell).astype(int) - self.corner
        known = ((cells >= 0) & (cells < self.grid.shape)).all(axis=1)
        at = np.full(len(cells), -np.inf)
        at[known] = self._depth[tuple(cells[known].T)]
        return at * self.cell

    def rim_share(self, points: np.ndarray, outside: float) -> tuple[float, float]:
        """Return which share of the foot of points (N, 2 or more) lies on the rim, within or close outside, and over
        which share of its length."""
        cells = np.unique(np.floor(points[:, :2] / self.cell).astype(int), axis=0)
        at = self.depth((cells + 0.5) * self.cell)
        on_rim = (at >= -outside) & (at <= max(self.cell, RIM * self.width))
        along = np.linalg.svd(cells - cells.mean(axis=0), full_matrices=False)[2][0] if len(cells) > 1 else np.ones(2)
        length, whole = np.ptp(cells @ along) + 1, np.ptp(np.argwhere(self.grid) @ along) + 1
        return float(on_rim.mean()), float(length / whole)


def cut_parts(cloud: Cloud, parts: np.ndarray) -> tuple[np.ndarray, set[int], dict[int, int]]:
    """Return the parts (V,) cut at level tops, which of the new ones stand on one, and {new part: the part that it was
    cut from}."""
    result, standing, cut_from = parts.copy(), set(), {}
    after = int(parts.max(initial=0)) + 1
    for top in _tops(cloud, parts):
        of_part = np.flatnonzero(result == top.part)
        if not len(of_part):
            continue
        points = cloud.vertices[of_part]
        inside, over = top.footprint.holds(points), points[:, 2] - top.level
        rise = _over_top(points, cloud.vertices[top.members], cloud.voxel)
        # What is over the top by less is of it; what lies flat on it begins lower than what stands.
        rest = np.flatnonzero(np.where(inside, (rise > LEAST_RISE * cloud.voxel) | (over < -RISE), True))
        for own in _groups(connected(points[rest], 2 * cloud.voxel), cloud.fewest):
            group = rest[own]
            rising, below = over[group] > RISE, over[group] < -RISE
            if not below.any():
                if np.quantile(rise[group], 0.75) > cloud.voxel and not _is_back(top, points[group], over[group]):
                    result[of_part[group]] = after
                    standing.add(after)
                    after += 1
                continue
            if rising.sum() < cloud.fewest or len(top.members) < TOP_SHARE * len(of_part):
                continue
            if ((over[group] > -APRON) & below & inside[group]).sum() >= cloud.fewest:
                # It hangs together with what is under the top: cut straight down.
                outline = Footprint(points[group[rising], :2], cloud.voxel)
                at_rim = top.footprint.depth(points[group]) < BACK
                group = group[rising | (at_rim & outline.holds(points[group]) & (np.abs(over[group]) > RISE))]
            if not _is_back(top, points[group], over[group]):
                result[of_part[group]] = after
                cut_from[after] = top.part
                after += 1
    return result, standing, cut_from


def _is_back(top: _Top, points: np.ndarray, over: np.ndarray) -> bool:
    """Whether what rises over a top stands along its rim, close by, over half of its length: a back, an arm, a side."""
    foot = points[(over > 0) & (over < APRON)]
    on_rim, length = top.footprint.rim_share(foot if len(foot) else points, THICK if top.level < SEAT else BACK)
    return on_rim >= ON_RIM and length >= ALONG


def join_parts(
    cloud: Cloud, parts: np.ndarray, standing: Collection[int], cut_from: Mapping[int, int], minimum_area: float
) -> np.ndarray:
    """Return the parts (V,) joined with the closest larger one between which and them the surface was not seen.

    Above or below it, or a scrap beside it, which is smaller than `minimum_area` [m^2]. What stands on a level top
    (`standing`) stays apart, and so does what was cut from each other.
    """
    result = parts.copy()
    large_enough = ((name, own) for name, own in members_of(parts, 0).items() if len(own) >= cloud.fewest)
    members = {name: own for name, own in large_enough if name not in standing}
    names = sorted(members)
    cells = {name: _cells(cloud.vertices[members[name]], cloud.voxel) for name in names}
    trees = {name: cKDTree(cloud.vertices[members[name]]) for name in names}
    corners = {
        name: (cloud.vertices[own].min(axis=0), cloud.vertices[own].max(axis=0)) for name, own in members.items()
    }
    low = {name: corners[name][0][2] for name in names}
    top = {
        name: _top_height(cloud.vertices[members[name]], cloud.normals[members[name]], cloud.voxel) for name in names
    }
    for small in names:
        neighbours: list[tuple[float, int]] = []
        for large in names:
            below, above = (small, large) if (low[small], small) < (low[large], large) else (large, small)
            if cut_from.get(small) == large or cut_from.get(large) == small:
                continue
            if (len(members[large]), large) <= (len(members[small]), small) or low[above] > top[below] - RISE:
                continue
            apart = np.maximum(corners[large][0] - corners[small][1], corners[small][0] - corners[large][1])
            if apart.max() > STACKED_GAP:
                continue
            near = trees[large].query(cloud.vertices[members[small]], distance_upper_bound=STACKED_GAP)[0]
            gap = float(near.min())
            common = len(np.intersect1d(cells[small], cells[large], assume_unique=True)) / len(cells[small])
            stacked = common >= STACKED_SHARE and gap < STACKED_GAP
            scrap = len(members[small]) < min(SCRAP_SHARE * len(members[large]), minimum_area / cloud.voxel**2)
            if stacked or (scrap and gap < SCRAP_DISTANCE):
                neighbours.append((gap, large))
        if neighbours:
            lower, gone = sorted((result[members[small][0]], result[members[min(neighbours)[1]][0]]))
            result[result == gone] = lower
    return result


def pieces_of(cloud: Cloud, free: np.ndarray, minimum_area: float) -> np.ndarray:
    """Return the piece (V,) int32 of every `free` vertex (V,), from 1 in the order of size; 0 of no piece.

    Left out is what has less than `minimum_area` [m^2] and does not stand on a level top.
    """
    parts = np.full(len(cloud.vertices), -1)
    members = np.flatnonzero(free)
    parts[members] = connected(cloud.vertices[members], 2 * cloud.voxel)
    parts, standing, cut_from = cut_parts(cloud, parts)
    standing |= _on_tops(cloud, parts, 0)
    joined = join_parts(cloud, parts, standing, cut_from, minimum_area)
    return numbered_pieces(cloud, joined, standing | set(cut_from), minimum_area)


def numbered_pieces(cloud: Cloud, parts: np.ndarray, cut: Collection[int], minimum_area: float) -> np.ndarray:
    """Return the parts (V,) that are large enough to be pieces, as in `pieces_of`; those that are `cut` from
    others may be small."""
    pieces = []
    for part, own in members_of(parts, 0).items():
        extent, low = np.ptp(cloud.vertices[own], axis=0), cloud.vertices[own, 2].min()
        large = len(own) * cloud.voxel**2 >= minimum_area and extent[:2].max() >= SMALLEST
        if (large and extent[2] >= LEAST_HEIGHT and low < HIGHEST) or (len(own) >= cloud.fewest and part in cut):
            pieces.append(own)
    piece = np.zeros(len(cloud.vertices), np.int32)
    ordered = sorted(pieces, key=lambda own: (-len(own), own[0]))
    for number, own in enumerate(ordered, 1):
        piece[own] = number
    return piece


def _tops(cloud: Cloud, parts: np.ndarray) -> list[_Top]:
    """Return the level tops of all parts, the largest first."""
    level = np.flatnonzero((parts >= 0) & (cloud.normals[:, 2] > LEVEL) & (cloud.vertices[:, 2] > LOWEST_TOP))
    tops = []
    # A step of more than a voxel parts two levels.
    levels = connected(cloud.vertices[level] * [1.0, 1.0, 2.0], 2 * cloud.voxel, parts[level])
    for own in _groups(levels, round(LEAST_TOP_AREA / cloud.voxel**2)):
        members = level[own]
        middle = float(np.median(cloud.vertices[members, 2]))
        tops.append(_Top(int(parts[members[0]]), members, middle, Footprint(cloud.vertices[members, :2], cloud.voxel)))
    return sorted(tops, key=lambda top: (-len(top.members), top.members[0]))


def members_of(labels: np.ndarray, first: int) -> dict[int, np.ndarray]:
    """Return {label: numbers of its members, ascending} of labels (N,) from `first` on, ascending."""
    if not len(labels):
        return {}
    order = np.argsort(labels, kind="stable")
    names, starts = np.unique(labels[order], return_index=True)
    groups = np.split(order, starts[1:])
    return {int(name): own for name, own in zip(names, groups, strict=True) if name >= first}


def _groups(labels: np.ndarray, fewest: int) -> list[np.ndarray]:
    """Return the numbers of the members of each label (N,) that has enough, in the order of the labels."""
    return [own for own in members_of(labels, 0).values() if len(own) >= fewest]


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
    return np.asarray(points[:, 2] - level - terms(points[:, :2]) @ shape)


def _cells(points: np.ndarray, voxel: float) -> np.ndarray:
    """Return the cells (C,) of a grid of two voxels over which points (N, 3) lie, each once, sorted."""
    cells = np.floor(points[:, :2] / (2 * voxel)).astype(np.int64)
    return np.unique(cells[:, 0] * 2**31 + cells[:, 1])


def _top_height(points: np.ndarray, normals: np.ndarray, voxel: float) -> float:
    """Return the height [m] at which most of the upward surface (N, 3) lies; infinite where it is no level top."""
    levels, counts = np.unique(np.round(points[normals[:, 2] > LEVEL, 2] / 0.03), return_counts=True)
    if counts.max(initial=0) * voxel**2 < LEAST_TOP_AREA:
        return np.inf
    return float(levels[counts.argmax()]) * 0.03


def _disc(reach: int) -> np.ndarray:
    steps = np.arange(-reach, reach + 1)
    return np.asarray(steps[:, None] ** 2 + steps[None] ** 2 <= reach**2)


TOLD = 0.75
"""Share of a part's views in a thing's masks from which on it is of the thing whatever its shape."""
WITHIN, BESIDE = 0.6, 0.1
"""A part is of the thing under or over which this share of it lies, or as far beside it [m]."""


def pieces_beside(
    cloud: Cloud, instance: np.ndarray, room: np.ndarray, told: np.ndarray, minimum_area: float
) -> Pieces:
    """Return the pieces beside things that masks found, as `pieces_of` does.

    instance (V,): things that masks found, 0 none; `room` (V,): what bounds the room; `told` (V,) 0..1: the share of
    looks that had the vertex in its thing. What stands on a thing's top is a piece unless most looks say that it is of
    it; what lies under its outline and touches it is of it: a leg that masks missed.
    """
    free = np.flatnonzero((instance == 0) & ~room)
    first = int(instance.max(initial=0)) + 1
    parts = np.where(room, -1, np.where(instance > 0, instance, -1)).astype(np.int64)
    parts[free] = first + connected(cloud.vertices[free], 2 * cloud.voxel)
    last = int(parts.max(initial=0))
    cut, standing, cut_from = cut_parts(cloud, parts)
    apart: set[int] = set()
    for part in np.unique(cut[(cut > last) & (instance > 0)]):
        own = cut == part
        if told[own].mean() >= TOLD:
            cut[own] = parts[own]
            standing.discard(int(part))
            cut_from.pop(int(part), None)
        elif (whole := _touching(cloud, own, instance == 0, cut)) >= 0:
            cut[own] = whole
            apart.add(whole)
    standing |= _on_tops(cloud, cut, first)
    thing_of = np.where(cut < first, np.maximum(cut, 0), 0).astype(np.int32)
    loose = [p for p in np.unique(cut[cut >= first]).tolist() if p <= last and p not in standing | apart]
    own_of, things = members_of(cut, first), _Things(cloud, thing_of)
    for part in loose:
        own = own_of[part]
        host = things.host(own)
        if host:
            thing_of[own], cut[own] = host, -1
            things.add(host, own)
    cut = np.where(cut < first, -1, cut)
    joined = join_parts(cloud, cut, standing, cut_from, minimum_area)
    return Pieces(numbered_pieces(cloud, joined, standing | set(cut_from) | apart, minimum_area), thing_of)


def _touching(cloud: Cloud, own: np.ndarray, free: np.ndarray, parts: np.ndarray) -> int:
    """Return the free part that most of the rim of `own` (V,) touches, -1 for none: a mask took the foot of a thing."""
    candidates = np.flatnonzero(free & (parts >= 0))
    if not len(candidates):
        return -1
    tree, reach = cKDTree(cloud.vertices[candidates]), 2 * cloud.voxel
    distance, nearest = tree.query(cloud.vertices[own], distance_upper_bound=reach)
    touched = parts[candidates[nearest[np.isfinite(distance)]]]
    return int(np.bincount(touched).argmax()) if len(touched) else -1


def _on_tops(cloud: Cloud, parts: np.ndarray, first: int) -> set[int]:
    """Return the parts from `first` on that begin on a level top of another and lie over it."""
    standing = set()
    tops = _tops(cloud, parts)
    members = members_of(parts, first) if tops else {}
    index = GroundIndex(cloud.vertices) if tops else None
    for top in tops:
        assert index is not None
        around = index.around(*top.footprint.bounds)
        over = (parts[around] >= first) & (parts[around] != top.part)
        around = around[over & (cloud.vertices[around, 2] > top.level - RISE)]
        candidates = np.unique(parts[around[top.footprint.holds(cloud.vertices[around])]])
        for part in candidates.tolist():
            points = cloud.vertices[members[part]]
            if points[:, 2].min() > top.level - RISE and top.footprint.holds(points).mean() > 0.5:
                standing.add(int(part))
    return standing


class _Things:
    """Things of masks, each as it is while loose parts are given to them."""

    def __init__(self, cloud: Cloud, thing_of: np.ndarray) -> None:
        self._cloud = cloud
        self._members = members_of(thing_of, 1)
        self._shapes: dict[int, _Shape] = {}

    def host(self, own: np.ndarray) -> int:
        """Return the thing that a loose part (numbers) is a leg or a leaf of, 0 for none: it touches it, is smaller,
        begins below its top and lies within its outline."""
        points, voxel = self._cloud.vertices[own], self._cloud.voxel
        low, high = points.min(axis=0) - BESIDE, points.max(axis=0) + BESIDE
        best, host = 0.0, 0
        for name in self._members:
            thing = self._shape(name)
            if (thing.high < low[:2]).any() or (thing.low > high[:2]).any():
                continue
            if len(thing.points) <= len(own) or points[:, 2].min() >= thing.top - RISE:
                continue
            touching = thing.tree.query(points, distance_upper_bound=2 * voxel)[0] < 2 * voxel
            if not touching.any():
                continue
            share = float((thing.outline.query(points[:, :2], distance_upper_bound=BESIDE)[0] < BESIDE).mean())
            if share >= WITHIN and share > best:
                best, host = share, name
        return host

    def add(self, thing: int, own: np.ndarray) -> None:
        """Let a part (numbers) be of a thing."""
        self._members[thing] = np.concatenate([self._members[thing], own])
        del self._shapes[thing]

    def _shape(self, name: int) -> _Shape:
        if name not in self._shapes:
            self._shapes[name] = _Shape(self._cloud.vertices[self._members[name]])
        return self._shapes[name]


class _Shape:
    """What is asked of the points (N, 3) of a thing."""

    def __init__(self, points: np.ndarray) -> None:
        self.points = points
        self.low, self.high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        self.top = float(np.quantile(points[:, 2], 0.75))

    @cached_property
    def tree(self) -> cKDTree:
        """In space."""
        return cKDTree(self.points)

    @cached_property
    def outline(self) -> cKDTree:
        """Seen from above."""
        return cKDTree(self.points[:, :2])


HELD = 0.3
"""A piece of which a single thing of masks has this share is that thing."""


def grown_things(
    cloud: Cloud, instance: np.ndarray, room: np.ndarray, sure: frozenset[int], minimum_area: float
) -> np.ndarray:
    """Return the things (V,) of masks, 0 none, each with all of the piece of which it alone has a part.

    Masks that have only the seat of a chair, or half of a sofa, are of the whole; those that are `sure` of a thing have
    all of it. Arguments as in `pieces_beside`.
    """
    piece = pieces_of(cloud, ~room, minimum_area)
    result = instance.copy()
    sizes = np.bincount(instance)
    for own in members_of(piece, 1).values():
        inside = np.bincount(instance[own], minlength=len(sizes))
        unnamed, inside[0] = inside[0], 0
        within = np.flatnonzero(inside >= 0.02 * len(own))
        if len(within) != 1 or not unnamed:
            continue
        thing = int(within[0])
        if thing not in sure and inside[thing] >= HELD * len(own) and inside[thing] >= 0.6 * sizes[thing]:
            result[own[instance[own] == 0]] = thing
    return result

"""Ours: runs of boxes in a mapped surface, for what rooms are built of (counters, cabinets, shelves, frames).

Where the surface has large flat places across the axes of its frame, space is cut into cells. Each patch of surface
says that the cell behind it is full and the cell before it empty; cells that the cameras saw to be empty are empty; and
where nothing says anything, the boundary of what is full has as little area without surface on it as can be. That is a
minimum cut, so the labelling is the best there is (Kolmogorov and Zabih, PAMI 2004; cells from planes as in Chauve et
al., CVPR 2010). Full cells are merged into boxes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.box_cover import merge_cells
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

EDGE = 0.025
"""Longest edge of a patch of surface [m]: larger triangles are cut."""
ACROSS = 0.8
"""Surface lies across an axis from this cosine of its normal on."""
BIN, CLOSEST, THIN = 0.01, 0.03, 0.012
"""Bin of the histogram in which flat places are sought, least distance of two cuts, and of the two sides of a board
[m]."""
LEAST_FLAT, FLAT_SHARE = 0.02, 0.04
"""A flat place has so much surface [m²], and this share of what faces the same way."""
EDGE_BIN, EDGE_SHARE, LEAST_GAP = 0.03, 0.3, 0.12
"""A flat place is looked along in steps of this [m]; it is there where a step has this share of the median step's
surface; and pieces of it so far apart have ends of their own [m]."""
YAW_BINS, YAW_REACH, YAW_ROUNDS = 45, math.radians(60.0), 5
"""Turns are counted in steps of two degrees; fronts within a quarter of this of the most frequent one say which it is,
in so many rounds."""
WALL = 0.02
"""Thickness of a cabinet's wall that was seen from inside and not from outside [m]."""
BOARD = 0.04
"""Distance below a level top at which a cut for its underside is offered: boards are about so thick, and rarely seen
from below [m]."""
SAMPLE = 0.06
"""Distance of the points at which cells are asked whether they were seen to be empty [m]."""
SEEN_EMPTY = 0.1
"""Depth that was seen to be empty [m] and is worth as much as surface."""
SMOOTHNESS = 0.3
"""Cost of a boundary without surface beside that of a patch against its side, the same area."""
CAPACITY = 1e5
"""Units of flow in a square metre."""


Cuts = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Patches:
    """A surface in small pieces, in the frame of its cells."""

    points: np.ndarray
    """(N, 3) middles [m]."""
    normals: np.ndarray
    """(N, 3) unit."""
    areas: np.ndarray
    """(N,) [m²]."""

    def chosen(self, rows: np.ndarray) -> Patches:
        """Return some of them, by rows or (N,) bool."""
        return Patches(self.points[rows], self.normals[rows], self.areas[rows])

    def turned(self, world_from_own: np.ndarray) -> Patches:
        """Return them in a frame whose axes are the columns of the rotation (3, 3)."""
        return Patches(self.points @ world_from_own, self.normals @ world_from_own, self.areas)


@dataclass(frozen=True)
class Cells:
    """Space cut into cells along the axes of a frame, and which of them are full."""

    cuts: Cuts
    """Of x, y and z, ascending [m]: one more than there are cells."""
    full: np.ndarray
    """(X, Y, Z) bool."""

    def boxes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return low and high corner (3,) [m] of boxes that partition what is full."""
        if not self.full.any():
            return []
        return [
            (
                np.array([self.cuts[a][first[a]] for a in range(3)]),
                np.array([self.cuts[a][last[a] + 1] for a in range(3)]),
            )
            for first, last in merge_cells(np.argwhere(self.full))
        ]

    def sides(self, axis: int, up: bool) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return low and high corner (3,) [m] of rectangles that partition what is full's boundary across an axis, on
        the side that looks along it (`up`) or against it."""
        full = np.moveaxis(self.full, axis, 0)
        beside = np.zeros_like(full)
        if up:
            beside[:-1] = full[1:]
        else:
            beside[1:] = full[:-1]
        bare = full & ~beside
        others = [a for a in range(3) if a != axis]
        rectangles = []
        for k in np.flatnonzero(bare.any(axis=(1, 2))):
            flat = np.argwhere(bare[k])
            for first, last in merge_cells(np.column_stack([flat, np.zeros(len(flat), int)])):
                low, high = np.zeros(3), np.zeros(3)
                low[axis] = high[axis] = self.cuts[axis][k + up]
                for side, a in enumerate(others):
                    low[a], high[a] = self.cuts[a][first[side]], self.cuts[a][last[side] + 1]
                rectangles.append((low, high))
        return rectangles

    def cut_at(self, axis: int, value: float) -> Cells:
        """Return the same with one cut more, where there is none yet within a millimetre."""
        cuts = list(self.cuts)
        index = int(np.searchsorted(cuts[axis], value))
        if np.abs(cuts[axis] - value).min() < 1e-3 or index in (0, len(cuts[axis])):
            return self
        cuts[axis] = np.insert(cuts[axis], index, value)
        full = np.insert(self.full, index, np.take(self.full, index - 1, axis=axis), axis=axis)
        return Cells((cuts[0], cuts[1], cuts[2]), full)

    def without(self, low: np.ndarray, high: np.ndarray) -> Cells:
        """Return the same but for the box from `low` to `high` (3,) [m], which is empty."""
        cells = self
        for axis in range(3):
            for value in (low[axis], high[axis]):
                cells = cells.cut_at(axis, float(value))
        full = cells.full.copy()
        middles = [0.5 * (c[:-1] + c[1:]) for c in cells.cuts]
        full[np.ix_(*[(m > low[a]) & (m < high[a]) for a, m in enumerate(middles)])] = False
        return Cells(cells.cuts, full)


def patches_of(mesh: EntityMesh) -> Patches:
    """Return the triangles of a mesh, large ones cut, in the world frame."""
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, EDGE, max_iter=12)
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(cross, axis=1)
    not_flat = double > 1e-12
    return Patches(corners[not_flat].mean(axis=1), cross[not_flat] / double[not_flat, None], 0.5 * double[not_flat])


def own_yaw(patches: Patches) -> float:
    """Return the turn about z [rad], within a quarter, in which most upright surface lies across x or y; 0 without any.

    The smallest box of an L, or of a run that was seen in part, lies askew to its fronts.
    """
    upright = np.abs(patches.normals[:, 2]) < 0.3
    if not upright.any():
        return 0.0
    around = np.exp(4j * np.arctan2(patches.normals[upright, 1], patches.normals[upright, 0]))
    weights = patches.areas[upright]
    bins = ((np.angle(around) + np.pi) / (2 * np.pi) * YAW_BINS).astype(int) % YAW_BINS
    counted = np.bincount(bins, weights=weights, minlength=YAW_BINS)
    turn = (int(np.argmax(counted)) + 0.5) * 2 * np.pi / YAW_BINS - np.pi
    for _ in range(YAW_ROUNDS):
        away = np.angle(around * np.exp(-1j * turn))
        in_reach = np.abs(away) < YAW_REACH
        turn += float(np.average(away[in_reach], weights=weights[in_reach])) if in_reach.any() else 0.0
    return turn / 4


def flat_places(coordinates: np.ndarray, areas: np.ndarray) -> list[tuple[float, float]]:
    """Return where along an axis much surface lies flat across it, and how much [m²]: coordinates and areas (N,)."""
    if len(coordinates) == 0:
        return []
    start = coordinates.min() - 2 * BIN
    histogram = np.bincount(((coordinates - start) / BIN).astype(int), weights=areas)
    smooth = np.convolve(np.pad(histogram, 1), [1.0, 1.0, 1.0], mode="same")
    least = max(LEAST_FLAT, FLAT_SHARE * float(areas.sum()))
    places = []
    while smooth.max(initial=0.0) >= least:
        k = int(np.argmax(smooth))
        middle = start + (k - 0.5) * BIN
        in_bin = np.abs(coordinates - middle) <= 1.5 * BIN
        position = float(np.average(coordinates[in_bin], weights=areas[in_bin])) if in_bin.any() else middle
        places.append((position, float(smooth[k])))
        reach = int(round(CLOSEST / BIN))
        smooth[max(0, k - reach) : k + reach + 1] = 0.0
    return places


def _edges(coordinates: np.ndarray, areas: np.ndarray) -> list[float]:
    """Return where the pieces of a flat place begin and end along an axis: coordinates, areas (N,) of its patches."""
    start = coordinates.min()
    histogram = np.bincount(((coordinates - start) / EDGE_BIN).astype(int), weights=areas)
    full_bins = np.flatnonzero(histogram > EDGE_SHARE * float(np.median(histogram[histogram > 0])))
    if len(full_bins) == 0:
        return []
    ends = np.flatnonzero(np.diff(full_bins) > LEAST_GAP / EDGE_BIN)
    firsts, lasts = full_bins[np.r_[0, ends + 1]], full_bins[np.r_[ends, len(full_bins) - 1]]
    return [start + EDGE_BIN * k for k in firsts] + [start + EDGE_BIN * (k + 1) for k in lasts]


@dataclass(frozen=True)
class Grid:
    """The cuts of three axes, and which of them surface lies at."""

    cuts: Cuts
    faced: tuple[np.ndarray, np.ndarray, np.ndarray]
    """(C, 2) bool for the cuts of each axis: whether there is a flat place that looks against it, along it."""


def grid_of(patches: Patches, low: np.ndarray, high: np.ndarray) -> Grid:
    """Return the cuts of every axis between the corners `low` and `high` (3,), these included, ascending: where surface
    lies flat across it, then the undersides of boards, then where flat places end."""
    flat: list[list[tuple[float, float, int]]] = [[], [], []]
    ends: list[list[float]] = [[], [], []]
    boards: list[float] = []
    for axis in range(3):
        for along, sign in enumerate((-1.0, 1.0)):
            facing = np.flatnonzero(sign * patches.normals[:, axis] > ACROSS)
            places = flat_places(patches.points[facing, axis], patches.areas[facing])
            flat[axis] += [(area, position, along) for position, area in places]
            boards += [position - BOARD for position, _ in places] if axis == 2 and along else []
            for position, _ in places:
                on_place = facing[np.abs(patches.points[facing, axis] - position) < CLOSEST]
                for across in {0, 1, 2} - {axis}:
                    ends[across] += _edges(patches.points[on_place, across], patches.areas[on_place])
    axes = [_axis(low[k], high[k], flat[k], [*(boards if k == 2 else []), *ends[k]]) for k in range(3)]
    return Grid((axes[0][0], axes[1][0], axes[2][0]), (axes[0][1], axes[1][1], axes[2][1]))


def _axis(
    low: float, high: float, flat: list[tuple[float, float, int]], others: list[float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cuts of an axis and (C, 2) which way they are faced. Flat places that look opposite ways may be as
    close as the two sides of a board; what is too close to a bound is at the bound."""
    cuts: list[tuple[float, set[int]]] = [(float(low), set()), (float(high), set())]
    for _, position, along in sorted(flat, reverse=True):
        bound = min(cuts[:2], key=lambda entry: abs(entry[0] - position))
        nearest = min(cuts, key=lambda entry: abs(entry[0] - position))
        if abs(bound[0] - position) < CLOSEST:
            bound[1].add(along)
        elif abs(nearest[0] - position) < THIN:
            nearest[1].add(along)
        elif low < position < high and (nearest[1] == {1 - along} or abs(nearest[0] - position) >= CLOSEST):
            cuts.append((position, {along}))
    for cut in others:
        if low < cut < high and min(abs(cut - cut_position) for cut_position, _ in cuts) >= CLOSEST:
            cuts.append((cut, set()))
    if 1 in cuts[0][1]:  # an inside was seen; its wall lies beyond
        cuts.append((low - WALL, set()))
    if 0 in cuts[1][1]:
        cuts.append((high + WALL, set()))
    cuts.sort(key=lambda entry: entry[0])
    return np.array([cut for cut, _ in cuts]), np.array([[0 in facings, 1 in facings] for _, facings in cuts])


def cells_of(
    patches: Patches, low: np.ndarray, high: np.ndarray, seen_empty: Callable[[np.ndarray], np.ndarray]
) -> Cells:
    """Return what is full behind a surface, between the corners `low` and `high` (3,).

    `seen_empty`: points (N, 3) of the cells' frame -> (N,) bool, whether the cameras saw that nothing is there.
    """
    grid = grid_of(patches, low, high)
    return Cells(grid.cuts, _labels(patches, grid, seen_empty))


def _cells(points: np.ndarray, cuts: Cuts) -> tuple[np.ndarray, np.ndarray]:
    """Return the index (N, 3) of the cell of points (N, 3), and whether there is one (N,)."""
    index = np.column_stack([np.searchsorted(cuts[a], points[:, a], side="right") - 1 for a in range(3)])
    shape = np.array([len(c) - 1 for c in cuts])
    return index, np.all((index >= 0) & (index < shape), axis=1)


def _labels(patches: Patches, grid: Grid, seen_empty: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return which cells are full (X, Y, Z), by a minimum cut."""
    cuts = grid.cuts
    shape = (len(cuts[0]) - 1, len(cuts[1]) - 1, len(cuts[2]) - 1)
    number = np.arange(int(np.prod(shape))).reshape(shape)
    full, empty = np.zeros(shape), _empty_volume(cuts, seen_empty) / SEEN_EMPTY
    rows, columns, costs = [], [], []
    edges = [np.diff(c) for c in cuts]
    for axis in range(3):
        first, second = [a for a in range(3) if a != axis]
        area = np.multiply.outer(edges[first], edges[second])
        against, along = (_on_cuts(patches, grid, axis, facing) for facing in (0, 1))
        bare = SMOOTHNESS * np.maximum(area[None] - against - along, 0.0)
        inner = np.moveaxis(number, axis, 0)
        full_here, empty_here = np.moveaxis(full, axis, 0), np.moveaxis(empty, axis, 0)
        full_here += along[1:] + against[:-1]
        empty_here += along[:-1] + against[1:]
        empty_here[-1] += bare[-1]
        if axis < 2:  # what stands on the floor shows no underside
            empty_here[0] += bare[0]
        rows.append(inner[:-1].ravel())
        columns.append(inner[1:].ravel())
        costs.append(bare[1:-1].ravel())
    source, sink, cells = number.size, number.size + 1, number.ravel()
    first_cell, second_cell, cost = np.concatenate(rows), np.concatenate(columns), np.concatenate(costs)
    capacity = np.concatenate([cost, cost, full.ravel(), empty.ravel()])
    starts = np.concatenate([first_cell, second_cell, np.full(number.size, source), cells])
    ends = np.concatenate([second_cell, first_cell, cells, np.full(number.size, sink)])
    units = np.round(CAPACITY * capacity).astype(np.int32)
    graph = csr_matrix((units, (starts, ends)), shape=(sink + 1, sink + 1), dtype=np.int32)
    residual = graph - maximum_flow(graph, source, sink).flow
    residual.data[residual.data < 0] = 0
    residual.eliminate_zeros()
    label = np.zeros(sink + 1, dtype=bool)
    label[breadth_first_order(residual, source, return_predecessors=False)] = True
    return label[: number.size].reshape(shape)


def _on_cuts(patches: Patches, grid: Grid, axis: int, facing: int) -> np.ndarray:
    """Return the surface [m²] on the faces across an axis that looks along it (`facing` 1) or against it (0):
    (cuts, first other axis, second other axis). A patch lies at the nearest cut that is faced its way, `CLOSEST`
    away at most."""
    cuts = grid.cuts
    others = [a for a in range(3) if a != axis]
    shape = (len(cuts[axis]), len(cuts[others[0]]) - 1, len(cuts[others[1]]) - 1)
    areas = np.zeros(shape)
    faced = np.flatnonzero(grid.faced[axis][:, facing])
    rows = np.flatnonzero((1.0 if facing else -1.0) * patches.normals[:, axis] > ACROSS)
    if len(faced) == 0 or len(rows) == 0:
        return areas
    points = patches.points[rows]
    far = np.abs(points[:, axis, None] - cuts[axis][faced][None])
    nearest = faced[far.argmin(axis=1)]
    on_cut = far.min(axis=1) < CLOSEST
    cell_index = [np.searchsorted(cuts[a], points[:, a], side="right") - 1 for a in others]
    for k in range(2):
        on_cut &= (cell_index[k] >= 0) & (cell_index[k] < shape[k + 1])
    np.add.at(areas, (nearest[on_cut], cell_index[0][on_cut], cell_index[1][on_cut]), patches.areas[rows][on_cut])
    return areas


def _empty_volume(cuts: Cuts, seen_empty: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the volume [m³] of every cell that the cameras saw to be empty (X, Y, Z)."""
    axes = []
    for c in cuts:
        count = max(1, int(round((c[-1] - c[0]) / SAMPLE)))
        edge = (c[-1] - c[0]) / count
        axes.append(c[0] + edge * (np.arange(count) + 0.5))
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    volume = float(np.prod([(c[-1] - c[0]) / len(axis) for c, axis in zip(cuts, axes, strict=True)]))
    index, inside = _cells(grid, cuts)
    empty = seen_empty(grid) & inside
    volumes = np.zeros(tuple(len(c) - 1 for c in cuts))
    np.add.at(volumes, tuple(index[empty].T), volume)
    return volumes

"""Which points of a surface hang together: by a grid of cells, since a room has tens of millions of pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.fuse.voxel_blocks import fill_table, find, pack
from scenewright.stages.kit.compiled import compiled


def connected(points: np.ndarray, reach: float, groups: np.ndarray | None = None) -> np.ndarray:
    """Return the connected part (N,) int of points (N, 3) [m] that are at most `reach` [m] apart, from 0 in the order
    of first appearance; only points of one of the `groups` (N,) hang together."""
    if not len(points):
        return np.zeros(0, int)
    points = np.ascontiguousarray(points, dtype=float)
    groups = np.zeros(len(points), np.int64) if groups is None else np.ascontiguousarray(groups, dtype=np.int64)
    return _parts(points, groups, cells_of(points, reach), reach * reach)


class Cells(NamedTuple):
    """Points sorted by the cubic cells that they lie in."""

    order: np.ndarray
    """(N,) numbers of the points, cell after cell."""
    starts: np.ndarray
    """(C + 1,) where in `order` each cell begins; last its length."""
    coordinates: np.ndarray
    """(C, 3) int32."""
    keys: np.ndarray
    slots: np.ndarray
    """Hash of the coordinates (`voxel_blocks.find`)."""


def cells_of(points: np.ndarray, edge: float) -> Cells:
    """Return the cells of points (N, 3), N > 0, with an `edge` of so much [m]."""
    cells = np.floor((points - points.min(axis=0)) / edge).astype(np.int32)
    order = np.lexsort(cells.T)
    is_first = np.append(True, (np.diff(cells[order], axis=0) != 0).any(axis=1))
    starts = np.append(np.flatnonzero(is_first), len(points))
    coordinates = cells[order[starts[:-1]]]
    size = 1 << int(np.ceil(np.log2(2 * len(coordinates) + 2)))
    keys, slots = np.full(size, -1, np.int64), np.zeros(size, np.int32)
    fill_table(keys, slots, coordinates, len(coordinates))
    return Cells(order, starts, coordinates, keys, slots)


@compiled
def neighbours_of(cells: Cells, cell: int) -> np.ndarray:
    """Return the numbers (M,) of a cell and of the later ones that touch it: so each pair of cells comes once."""
    x, y, z = cells.coordinates[cell]
    found, count = np.empty(27, dtype=np.int64), 0
    for k in range(27):
        other = find(cells.keys, cells.slots, pack(x + k % 3 - 1, y + k // 3 % 3 - 1, z + k // 9 - 1))
        if other >= cell:
            found[count] = other
            count += 1
    return found[:count]


@compiled
def _parts(points: np.ndarray, groups: np.ndarray, cells: Cells, limit: float) -> np.ndarray:
    order, starts = cells.order, cells.starts
    above = np.arange(len(points))
    for cell in range(len(cells.coordinates)):
        for other in neighbours_of(cells, cell):
            for a in range(starts[cell], starts[cell + 1]):
                for b in range(a + 1 if other == cell else starts[other], starts[other + 1]):
                    _join(points, groups, above, order[a], order[b], limit)
    number = np.full(len(points), -1)
    result = np.empty(len(points), np.int64)
    count = 0
    for k in range(len(points)):
        root = _root(above, k)
        if number[root] < 0:
            number[root] = count
            count += 1
        result[k] = number[root]
    return result


@compiled
def _join(points: np.ndarray, groups: np.ndarray, above: np.ndarray, i: int, j: int, limit: float) -> None:
    first, second = _root(above, i), _root(above, j)
    if first == second or groups[i] != groups[j]:
        return
    distance = 0.0
    for axis in range(3):
        distance += (points[i, axis] - points[j, axis]) * (points[i, axis] - points[j, axis])
    if distance <= limit:
        above[max(first, second)] = min(first, second)


@compiled
def _root(above: np.ndarray, k: int) -> int:
    while above[k] != k:
        above[k] = above[above[k]]
        k = above[k]
    return k

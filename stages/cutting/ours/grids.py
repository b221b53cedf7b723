"""Ways to lay out any number of cells in a box: layers, rows in each, cells in each row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations

import numpy as np
from scenewright.schemas.cutting_demonstrations import CategoryName
from scenewright.stages.cutting.demonstrations.recipes import LONG
from scenewright.stages.cutting.meaning import MEANINGS
from scenewright.stages.cutting.ours.cells import Split, Tree
from scenewright.stages.cutting.world.knife import Knife


@dataclass(frozen=True)
class Grid:
    """Layers across one direction, rows in each across another, cells in each row across the third. Counts of
    neighbours differ by one at most, so that any number can be laid out."""

    axes: tuple[int, ...]
    layers: int
    rows: int
    misfit: float
    """Of the cell that is least what the word says."""
    thinnest: float
    """Thinnest edge of a cell [m]."""

    def tree(self, count: int, slabs: bool) -> Tree:
        """Return the cuts that make `count` cells."""
        return _tree(count, self.axes, (self.layers, self.rows, count), slabs)


def grids_of(edges: np.ndarray, thing: np.ndarray, count: int, name: CategoryName) -> list[Grid]:
    """Return grids of so many cells in a box (3,) [m] of a thing (3,), those first whose worst cell is likest to the
    word, and of these those whose cells are alike; only such as the blade can cut, where there are any."""
    meaning = MEANINGS[name]
    layers, rows = _ways(count)
    found: list[tuple[bool, float, float, Grid]] = []
    for axes in permutations(range(3)):
        kept = np.ones(len(layers), dtype=bool)
        kinds = []
        for in_layer in (count // layers, -(-count // layers)):
            for in_row in (in_layer // rows, -(-in_layer // rows)):
                kept &= in_row > 0
                per_row = np.maximum(in_row, 1)
                cell = np.empty((len(layers), 3))
                for axis, parts in zip(axes, (count / in_layer, in_layer / per_row, per_row), strict=True):
                    kept &= (axis in meaning.across) | (parts == 1)
                    cell[:, axis] = edges[axis] / parts
                kinds.append(cell)
        misfits = np.max([meaning.misfit(np.sort(cell, axis=1), cell[:, LONG], thing) for cell in kinds], axis=0)
        unlike = np.ptp([cell.max(axis=1) for cell in kinds], axis=0)
        thinnest = np.min([cell.min(axis=1) for cell in kinds], axis=0)
        too_large = _too_large(edges[list(axes)], layers, rows, count)
        for k in np.flatnonzero(kept):
            grid = Grid(axes, int(layers[k]), int(rows[k]), float(misfits[k]), float(thinnest[k]))
            found.append((bool(too_large[k]), round(grid.misfit, 9), float(unlike[k]), grid))
    found.sort(key=lambda row: row[:3])
    return [grid for too_large, *_, grid in found if too_large == found[0][0]]


def _too_large(edges: np.ndarray, layers: np.ndarray, rows: np.ndarray, count: int) -> np.ndarray:
    """Return whether a face of a cut is longer or higher than the blade (N,), in the order of the cuts."""
    knife = Knife()
    layer, row = edges[0] / layers, edges[1] / rows
    faces = (
        (layers > 1, np.full_like(layer, edges[1]), edges[2]),
        (rows > 1, layer, edges[2]),
        (layers * rows < count, layer, row),
    )
    beyond = [cut & ((np.maximum(a, b) > knife.length) | (np.minimum(a, b) > knife.height)) for cut, a, b in faces]
    return np.asarray(np.any(beyond, axis=0))


@lru_cache(maxsize=256)
def _ways(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return all numbers of layers and of rows in each (N,), (N,)."""
    pairs = [(layers, rows) for layers in range(1, count + 1) for rows in range(1, count // layers + 1)]
    return np.array([a for a, _ in pairs]), np.array([b for _, b in pairs])


def _tree(count: int, axes: Sequence[int], parts: Sequence[int], slabs: bool) -> Tree:
    """Return `count` leaves in so many parts along the first axis, each in so many along the next, evenly."""
    if count == 1:
        return None
    number = min(parts[0], count)
    counts = [(k + 1) * count // number - k * count // number for k in range(number)]
    below = [_tree(each, axes[1:], parts[1:], slabs) if len(axes) > 1 else None for each in counts]
    if number == 1:
        return below[0]
    return Split(axes[0], tuple(below), tuple(float(each) for each in counts), slabs)

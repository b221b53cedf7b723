"""Overlap of fragments in their canonical frames, and the best matching of two sets of fragments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cutting.world.canonical import Canonical
from scenewright.stages.cutting.world.voxels import Grid
from scipy.optimize import linear_sum_assignment

VOXELS = 48
"""Voxels along the longest edge of the two fragments; by eye."""


def overlaps(made: Sequence[Canonical], wanted: Sequence[Canonical]) -> np.ndarray:
    """Return the intersection over union of every pair (made, wanted), each in its canonical frame, by voxels."""
    longest = [[float(shape.size.max()) for shape in shapes] for shapes in (made, wanted)]
    filled: dict[tuple[int, int, float], tuple[Grid, np.ndarray]] = {}

    def voxels(side: int, number: int, voxel: float) -> tuple[Grid, np.ndarray]:
        key = (side, number, voxel)
        if key not in filled:
            filled[key] = (made, wanted)[side][number].voxels(voxel)
        return filled[key]

    table = np.zeros((len(made), len(wanted)))
    for i, first in enumerate(longest[0]):
        for j, second in enumerate(longest[1]):
            voxel = max(first, second) / VOXELS
            table[i, j] = overlap(voxels(0, i, voxel), voxels(1, j, voxel))
    return table


def overlap(first: tuple[Grid, np.ndarray], second: tuple[Grid, np.ndarray]) -> float:
    """Return the intersection over union of two sets of voxels whose grids fit each other."""
    starts = [np.round(grid.origin / grid.voxel).astype(int) for grid, _ in (first, second)]
    low = np.maximum(*starts)
    high = np.minimum(*(start + filled.shape for start, (_, filled) in zip(starts, (first, second), strict=True)))
    counts = [int(filled.sum()) for _, filled in (first, second)]
    common = 0
    if (high > low).all():
        grids = [
            filled[tuple(slice(a, b) for a, b in zip(low - start, high - start, strict=True))]
            for start, (_, filled) in zip(starts, (first, second), strict=True)
        ]
        common = int((grids[0] & grids[1]).sum())
    union = sum(counts) - common
    return common / union if union else 0.0


def best_pairs(gain: np.ndarray) -> list[tuple[int, int]]:
    """Return the pairs (row, column) of the assignment with the greatest sum (Kuhn 1955)."""
    rows, columns = linear_sum_assignment(-gain)
    return list(zip(rows.tolist(), columns.tolist(), strict=True))

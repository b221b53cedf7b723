"""Which points lie over a rectangle of the ground, without a look at all of them: a map may be a whole building."""

from __future__ import annotations

import numpy as np

CELL = 0.5
"""Edge of the cells into which the ground is cut [m]."""
ROW = 1 << 31
"""Number of cells in a row of the ground."""


class GroundIndex:
    """Points (N, 3) [m], z up, sorted by the cell of the ground over which they lie."""

    def __init__(self, points: np.ndarray) -> None:
        cells = np.floor(points[:, :2] / CELL).astype(np.int64)
        keys = cells[:, 0] * ROW + cells[:, 1]
        self._order = np.argsort(keys, kind="stable")
        self._keys = keys[self._order]
        self._first = int(cells[:, 0].min(initial=0))
        self._last = int(cells[:, 0].max(initial=-1))

    def around(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the numbers of all points over a rectangle between two corners (2,) or (3,) [m], and of some beside
        it, less than a cell away; each once."""
        (x0, y0), (x1, y1) = (np.floor(corner[:2] / CELL).astype(np.int64) for corner in (low, high))
        rows = np.arange(max(x0, self._first), min(x1, self._last) + 1) * ROW
        starts, ends = np.searchsorted(self._keys, rows + y0), np.searchsorted(self._keys, rows + y1 + 1)
        found = [self._order[start:end] for start, end in zip(starts, ends, strict=True)]
        return np.concatenate(found) if found else np.zeros(0, np.int64)

"""Where thin bars may lie in a map of what is item and what is not: a Hough transform of bars of a known length.

For every direction the item's pixels are counted in cells along and across it; a bar is a row of cells that holds many
while the rows beside it hold few, so that broad patches (a shadow, a dish) do not look like bundles of bars.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled

ALONG, ACROSS = 4.0, 2.5
"""Cells [px]."""
FLANK = 0.6
"""What is beside a bar counts against it by this."""
DIRECTIONS = 45
"""Directions of bars in half a turn; by eye."""


@compiled
def _cells(
    rows: np.ndarray, columns: np.ndarray, cos: float, sin: float, lowest: tuple[float, float], counts: np.ndarray
) -> None:
    counts[:] = 0.0
    for i in range(len(rows)):
        s = columns[i] * cos + rows[i] * sin
        r = rows[i] * cos - columns[i] * sin
        counts[int((r - lowest[1]) / ACROSS), int((s - lowest[0]) / ALONG)] += 1.0


@compiled
def bar_candidates(rows: np.ndarray, columns: np.ndarray, length: float, most: int) -> np.ndarray:
    """Return (N, 4) bars (votes, u [px], v [px], direction [rad]), most votes first, N <= `most`, of the item's pixels
    `rows`, `columns` (P,) [px]; `length` [px] of a bar. No two lie within 8 px and 10 degrees of each other."""
    best = np.zeros((2 * DIRECTIONS, 4))
    if len(rows) == 0:
        return best[:0]
    window = max(3, int(0.94 * length / ALONG))
    for d in range(DIRECTIONS):
        angle = np.pi * d / DIRECTIONS
        cos, sin = np.cos(angle), np.sin(angle)
        s0, s1, r0, r1 = np.inf, -np.inf, np.inf, -np.inf
        for i in range(len(rows)):
            s = columns[i] * cos + rows[i] * sin
            r = rows[i] * cos - columns[i] * sin
            s0, s1, r0, r1 = min(s0, s), max(s1, s), min(r0, r), max(r1, r)
        lowest = (s0 - window * ALONG, r0 - 6.0 * ACROSS)
        shape = (int((r1 - lowest[1]) / ACROSS) + 7, int((s1 - lowest[0]) / ALONG) + window + 1)
        counts = np.zeros(shape)
        _cells(rows, columns, cos, sin, lowest, counts)
        # Sums over the window along the bar, in place of single cells.
        sums = np.zeros((shape[0], shape[1] - window + 1))
        for i in range(shape[0]):
            total = 0.0
            for j in range(shape[1]):
                total += counts[i, j]
                if j >= window:
                    total -= counts[i, j - window]
                if j >= window - 1:
                    sums[i, j - window + 1] = total
        for turn in range(2):
            top, row, column = 0.0, -1, -1
            for i in range(5, shape[0] - 5):
                for j in range(sums.shape[1]):
                    inside = sums[i - 1, j] + sums[i, j] + sums[i + 1, j]
                    if inside <= top:
                        continue
                    beside = sums[i - 5, j] + sums[i - 4, j] + sums[i + 4, j] + sums[i + 5, j]
                    vote = inside - FLANK * 0.75 * beside
                    if vote > top:
                        top, row, column = vote, i, j
            if row < 0:
                break
            s = lowest[0] + (column + 0.5 * window) * ALONG
            r = lowest[1] + (row + 0.5) * ACROSS
            k = 2 * d + turn
            best[k, 0], best[k, 1], best[k, 2], best[k, 3] = top, s * cos - r * sin, s * sin + r * cos, angle
            for i in range(max(0, row - 3), min(shape[0], row + 4)):
                for j in range(max(0, column - window // 2), min(sums.shape[1], column + window // 2)):
                    sums[i, j] = 0.0
    result = np.zeros((most, 4))
    count = 0
    for k in np.argsort(-best[:, 0]):
        if best[k, 0] <= 0.0 or count == most:
            break
        apart = True
        for chosen in range(count):
            turned = abs(best[k, 3] - result[chosen, 3]) % np.pi
            turned = min(turned, np.pi - turned)
            distance = np.hypot(best[k, 1] - result[chosen, 1], best[k, 2] - result[chosen, 2])
            if turned < 0.175 and distance < 8.0:
                apart = False
        if apart:
            result[count] = best[k]
            count += 1
    return result[:count]

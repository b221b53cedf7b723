"""Votes of height edges for centres of circles: compiled, one pass over the image for all radii."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled


@compiled
def cast_votes(
    blurred: np.ndarray,
    smooth: np.ndarray,
    radii: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    focal: float,
    camera_height: float,
    steepest: float,
) -> np.ndarray:
    """Return (K, h // 2 + 1, w // 2 + 1) votes for centres of circles of K radii [m] with lips between heights `low`
    and `high` [m], at half resolution.

    Each pixel of the heights `blurred` (h, w) whose gradient (Sobel, over 8) exceeds `steepest` [m/px] votes, for each
    radius that the highest of 5 x 5 pixels of `smooth` (h, w) around it may be the lip of, at that radius up the
    gradient.
    """
    rows, columns = blurred.shape
    votes = np.zeros((len(radii), rows // 2 + 1, columns // 2 + 1), np.float32)
    limit = (8.0 * steepest) ** 2
    lowest = low.min()
    for r in range(2, rows - 2):
        for c in range(2, columns - 2):
            right = blurred[r - 1, c + 1] + 2.0 * blurred[r, c + 1] + blurred[r + 1, c + 1]
            left = blurred[r - 1, c - 1] + 2.0 * blurred[r, c - 1] + blurred[r + 1, c - 1]
            gx = right - left
            below = blurred[r + 1, c - 1] + 2.0 * blurred[r + 1, c] + blurred[r + 1, c + 1]
            above = blurred[r - 1, c - 1] + 2.0 * blurred[r - 1, c] + blurred[r - 1, c + 1]
            gy = below - above
            square = gx * gx + gy * gy
            if square < limit:
                continue
            lip = smooth[r, c]
            for i in range(r - 2, r + 3):
                for j in range(c - 2, c + 3):
                    lip = max(lip, smooth[i, j])
            if lip <= lowest:
                continue
            size = np.sqrt(square)
            for k in range(len(radii)):
                if low[k] < lip < high[k]:
                    reach = focal / (camera_height - lip) * radii[k]
                    u, v = c + reach * gx / size, r + reach * gy / size
                    column, row = int(0.5 * u), int(0.5 * v)
                    if u > 0.0 and v > 0.0 and column < votes.shape[2] - 1 and row < votes.shape[1] - 1:
                        votes[k, row, column] += 1.0
    return votes

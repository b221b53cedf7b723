"""Gradient-boosted trees for a yes-or-no question: scoring in numba, the arrays kept as safetensors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numba import njit

from schemas.errors import BadInput

Trees = tuple[np.ndarray, np.ndarray, np.ndarray, float]
"""Feature of every inner node (T, 2^d - 1) int32, its threshold (T, 2^d - 1) float32 (above goes right), value of every
leaf (T, 2^d) float32, and the score of no tree at all."""
NO_TREES: Trees = (
    np.zeros((0, 1), dtype=np.int32),
    np.zeros((0, 1), dtype=np.float32),
    np.zeros((0, 2), dtype=np.float32),
    0.0,
)


@njit(cache=True)
def score_rows(row: np.ndarray, trees: tuple[np.ndarray, np.ndarray, np.ndarray, float]) -> float:
    """Return the log-odds of one row of features (F,) float32."""
    features, thresholds, values, base = trees
    inner = features.shape[1]
    total = base
    for tree in range(features.shape[0]):
        node = 0
        while node < inner:
            node = 2 * node + (2 if row[features[tree, node]] > thresholds[tree, node] else 1)
        total += values[tree, node - inner]
    return total

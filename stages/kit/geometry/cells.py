"""Rows of integers, as the cells that points lie in, told apart by one number each."""

from __future__ import annotations

import math

import numpy as np

LARGEST_KEY = 2**62
"""Largest product of the numbers of cells that fits one 64-bit key."""


def row_keys(rows: np.ndarray) -> np.ndarray:
    """Return (N,) int64: numbers that are equal where rows (N, K) of int64 are, and in the rows' order.

    `np.unique` sorts them ten times as fast as rows.
    """
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    low = rows.min(axis=0)
    spans = [int(high) - int(least) + 1 for high, least in zip(rows.max(axis=0), low, strict=True)]
    if math.prod(spans) > LARGEST_KEY:
        return np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
    keys = rows[:, 0] - low[0]
    for k in range(1, rows.shape[1]):
        keys = keys * spans[k] + (rows[:, k] - low[k])
    return keys


def cell_keys(points: np.ndarray, edge: float) -> np.ndarray:
    """Return (N,) int64: a number for the cube of `edge` [m] that each of the points (N, 3) lies in."""
    return row_keys(np.floor(points / edge).astype(np.int64))

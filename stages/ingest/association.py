"""Which depth image belongs to which colour image."""

from __future__ import annotations

import numpy as np


def mutual_nearest(first: np.ndarray, second: np.ndarray, maximum_difference: int) -> np.ndarray:
    """Return for each of the sorted stamps `first` (N,) [ns] the index of its partner in sorted `second` (M,), or -1.

    Partners are nearest to each other and at most `maximum_difference` [ns] apart, so no image is used twice.
    """
    first, second = np.asarray(first, dtype=np.int64), np.asarray(second, dtype=np.int64)
    if len(first) == 0 or len(second) == 0:
        return np.full(len(first), -1)
    forward, back = _nearest(first, second), _nearest(second, first)
    mutual = back[forward] == np.arange(len(first))
    close = np.abs(second[forward] - first) <= maximum_difference
    return np.where(mutual & close, forward, -1)


def _nearest(queries: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    after = np.clip(np.searchsorted(stamps, queries), 0, len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(stamps[after] - queries) < np.abs(queries - stamps[before]), after, before)

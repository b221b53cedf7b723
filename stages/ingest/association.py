"""Which images belong together: partners are nearest to each other in time."""

from __future__ import annotations

import numpy as np


def mutual_nearest(first: np.ndarray, second: np.ndarray, maximum_difference: int) -> np.ndarray:
    """Return for each of the sorted stamps `first` (N,) [ns] the index of its partner in sorted `second` (M,), or -1.

    Partners are nearest to each other and at most `maximum_difference` [ns] apart, so no image is used twice. Of
    equal stamps in `first` the first one is partnered, of those in `second` one of them.
    """
    first, second = np.asarray(first, dtype=np.int64), np.asarray(second, dtype=np.int64)
    if len(first) == 0 or len(second) == 0:
        return np.full(len(first), -1)
    forward, back = _nearest(first, second), _nearest(second, first)
    mutual = back[forward] == np.arange(len(first))
    close = np.abs(second[forward] - first) <= maximum_difference
    return np.where(mutual & close, forward, -1)


def partners(first: np.ndarray, second: np.ndarray, maximum_difference: int) -> np.ndarray:
    """Return what `mutual_nearest` does for sorted stamps that may repeat: a repeated stamp in `first` gets no partner,
    as the image before it has it already, and of a repeated stamp in `second` the first counts."""
    first, second = np.asarray(first, dtype=np.int64), np.asarray(second, dtype=np.int64)
    partner_of = np.full(len(first), -1)
    fresh_first, fresh_second = fresh(first), np.flatnonzero(fresh(second))
    nearest = mutual_nearest(first[fresh_first], second[fresh_second], maximum_difference)
    partner_of[fresh_first] = np.where(nearest >= 0, fresh_second[nearest] if len(fresh_second) else -1, -1)
    return partner_of


def fresh(stamps: np.ndarray) -> np.ndarray:
    """Return (N,) bool: which of the sorted stamps differ from the one before."""
    return np.concatenate([np.ones(min(1, len(stamps)), bool), np.diff(stamps) > 0])


def _nearest(queries: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    after = np.clip(np.searchsorted(stamps, queries), 0, len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(stamps[after] - queries) < np.abs(queries - stamps[before]), after, before)

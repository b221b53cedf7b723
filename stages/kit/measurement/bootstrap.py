"""Percentile bootstrap intervals (Efron 1979)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Interval:
    """An estimate and its two-sided interval."""

    value: float
    low: float
    high: float


def bootstrap_interval(
    values: np.ndarray,
    random: np.random.Generator,
    *,
    statistic: Callable[..., np.ndarray] = np.mean,
    level: float = 0.95,
    resamples: int = 2000,
) -> Interval | None:
    """Percentile interval of a statistic of independent values.

    `values` (N,); `statistic` takes `axis=` (np.mean, np.median). Returns None for no value; with a single value
    the interval has no width and says nothing.
    """
    values = np.asarray(values, dtype=float)
    if not len(values):
        return None
    rows = random.integers(0, len(values), size=(resamples, len(values)))
    resampled = statistic(values[rows], axis=1)
    tail = (1.0 - level) / 2.0
    low, high = np.quantile(resampled, [tail, 1.0 - tail])
    return Interval(float(statistic(values, axis=0)), float(low), float(high))

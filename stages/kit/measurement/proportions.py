"""Intervals of shares of successes."""

from __future__ import annotations


def wilson_interval(successes: int, count: int) -> tuple[float, float]:
    """Return the two-sided 95 % interval of a proportion (Wilson 1927): (low, high) in 0 to 1.

    Raises ValueError for no tries or more successes than tries.
    """
    from scipy import stats

    interval = stats.binomtest(successes, count).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)

"""Percentile bootstrap intervals (Efron 1979)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

Sample = TypeVar("Sample")


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


def figure_interval(
    figure: Callable[[Sequence[Sample]], float | None],
    samples: Sequence[Sample],
    random: np.random.Generator,
    *,
    resamples: int,
) -> Interval | None:
    """95 % percentile interval of any figure over whole samples (rooms), drawn with replacement.

    None where the figure is None of the samples as they are; draws of which it is None are left out, and without any
    other the interval has no width.
    """
    value = figure(samples)
    if value is None:
        return None
    drawn = [figure([samples[k] for k in rows]) for rows in _draws(len(samples), random, resamples)]
    return _around(value, [drawn_value for drawn_value in drawn if drawn_value is not None])


def paired_interval(
    figure: Callable[[Sequence[Sample]], float | None],
    first: Sequence[Sample],
    second: Sequence[Sample],
    random: np.random.Generator,
    *,
    resamples: int,
) -> Interval | None:
    """95 % percentile interval of a figure of `first` minus that of `second`, both on the same draws.

    Both hold the same rooms in the same order; ValueError when they are not as many. None where either figure is.
    """
    if len(first) != len(second):
        raise ValueError(f"{len(first)} and {len(second)} samples are no pairs")
    value, other_value = figure(first), figure(second)
    if value is None or other_value is None:
        return None
    drawn = []
    for rows in _draws(len(first), random, resamples):
        a, b = figure([first[k] for k in rows]), figure([second[k] for k in rows])
        if a is not None and b is not None:
            drawn.append(a - b)
    return _around(value - other_value, drawn)


def pooled_interval(
    parts: np.ndarray, other: np.ndarray | None, random: np.random.Generator, *, resamples: int
) -> Interval | None:
    """95 % percentile interval of a sum over a sum, or of that less the same of `other` on the same draws.

    `parts` and `other` (N, 2): what each sample adds above and below the line. The draws are those of `figure_interval`
    and `paired_interval`, without a call for each. None where there is nothing below the line.
    """
    rows = _draws(len(parts), random, resamples)
    value, drawn = _ratios(parts, rows)
    if other is not None:
        subtracted, others = _ratios(other, rows)
        value, drawn = value - subtracted, drawn - others
    if not np.isfinite(value):
        return None
    return _around(value, drawn[np.isfinite(drawn)].tolist())


def _ratios(sums_of_units: np.ndarray, rows: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the ratio of all samples and of each draw, NaN with nothing below the line."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sums, all_of_them = sums_of_units[rows].sum(axis=1), sums_of_units.sum(axis=0)
        drawn = np.where(sums[:, 1] > 0, sums[:, 0] / sums[:, 1], np.nan)
        return float(all_of_them[0] / all_of_them[1]) if all_of_them[1] > 0 else np.nan, drawn


def _draws(count: int, random: np.random.Generator, resamples: int) -> np.ndarray:
    return random.integers(0, count, size=(resamples, count))


def _around(value: float, drawn: Sequence[float]) -> Interval:
    low, high = np.quantile(drawn, [0.025, 0.975]) if drawn else (value, value)
    return Interval(float(value), float(low), float(high))

"""Figures over rooms: means with intervals by Student's t, so that a few rooms do not look like many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.measurement.proportions import wilson_interval
from scipy import stats

LEAST_ROOMS = 5
"""With fewer an interval says nothing."""
CONFIDENCE = 0.95
POWER = 0.8
"""With which a difference of `least_seen` would have been seen."""


@dataclass(frozen=True)
class Spread:
    """A mean over rooms: `low` and `high` are None with fewer than five rooms, or where no interval has width."""

    mean: float
    low: float | None
    high: float | None
    deviation: float | None
    """Standard deviation between rooms."""
    rooms: int
    least_seen: float | None
    """The smallest true difference from a given number that so many rooms show four times of five."""


def over_rooms(values: Sequence[float], *, share: bool = False) -> Spread | None:
    """Return the mean of one value a room with its 95 % interval; None without any.

    Where all rooms say the same t has no width: a `share` takes Wilson's interval (1927) of so many tries then, which
    is exact for rooms that all failed or all succeeded; other figures have none.
    """
    if not len(values):
        return None
    rooms, mean = len(values), float(np.mean(values))
    if rooms < LEAST_ROOMS:
        return Spread(mean, None, None, float(np.std(values, ddof=1)) if rooms > 1 else None, rooms, None)
    deviation = float(np.std(values, ddof=1))
    error = deviation / np.sqrt(rooms)
    reach = float(stats.t.ppf(0.5 + CONFIDENCE / 2, rooms - 1))
    least = (reach + float(stats.t.ppf(POWER, rooms - 1))) * error
    if deviation > 0:
        low, high = mean - reach * error, mean + reach * error
        return Spread(mean, max(low, 0.0) if share else low, min(high, 1.0) if share else high, deviation, rooms, least)
    if share and mean in (0.0, 1.0):
        low, high = wilson_interval(round(mean * rooms), rooms)
        return Spread(mean, low, high, deviation, rooms, None)
    return Spread(mean, None, None, deviation, rooms, None)


def paired(first: Sequence[float | None], second: Sequence[float | None]) -> Spread | None:
    """Return the mean of first minus second over the rooms in which both are defined."""
    pairs = zip(first, second, strict=True)
    return over_rooms([a - b for a, b in pairs if a is not None and b is not None])

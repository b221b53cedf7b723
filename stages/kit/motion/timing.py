"""Give a path its times: speed and acceleration limits of every joint, along the path and where it bends."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

BEND = 1e-9
"""Changes of direction below this (seconds at the acceleration limit) are none."""


def time_path(
    path: np.ndarray, speed: np.ndarray, acceleration: np.ndarray, *, spacing: float = 0.02
) -> tuple[np.ndarray, np.ndarray]:
    """Return times (M,) [s] from 0 and points (M, D) along a path (N, D) of straight pieces.

    `speed` and `acceleration` (D,) bound each joint everywhere, bends included: there the direction changes over half
    a step before and after the bend, and as half of the acceleration goes into that, only half is left for changing
    the speed. `spacing` is the distance of points, in the unit of a joint that moves at speed 1. A forward and a
    backward pass make the speed reachable: time-optimal along the path but for the halves (Bobrow, Dubowsky & Gibson
    1985, IJRR 4(3)). It starts and ends at rest.
    """
    path = np.asarray(path, dtype=float)
    if len(path) < 2 or np.abs(np.diff(path, axis=0)).max() < 1e-12:
        return np.zeros(1), path[:1]
    rows = [path[:1]]
    for first, second in zip(path[:-1], path[1:], strict=True):
        duration = float(np.max(np.abs(second - first) / speed))
        if duration < 1e-12:
            continue
        count = max(1, int(np.ceil(duration / spacing)))
        rows.append(first + (second - first) * (np.arange(1, count + 1) / count)[:, None])
    points = np.concatenate(rows)
    if len(points) == 2:  # at rest at both ends, it has to move in between
        points = np.array([points[0], (points[0] + points[1]) / 2, points[1]])
    steps = np.diff(points, axis=0)
    # s counts seconds at full speed, so ds/dt <= 1 everywhere.
    lengths = np.max(np.abs(steps) / speed, axis=1)
    tangents = steps / lengths[:, None]
    turn = np.max(np.abs(np.diff(tangents, axis=0)) / acceleration, axis=1)
    strength = np.min(acceleration / np.maximum(np.abs(tangents), 1e-9), axis=1)
    bent = np.concatenate([[False], turn > BEND, [False]])
    strength[bent[:-1] | bent[1:]] /= 2
    # The bend takes the time of one step, which is left at a rate of at most sqrt(rate^2 + strength * L):
    # turn * rate * sqrt(rate^2 + strength * L) = L / 2, solved for the square of the rate.
    shorter = np.minimum(lengths[:-1], lengths[1:])
    gain = np.maximum(strength[:-1], strength[1:]) * shorter
    square = (np.sqrt(gain**2 + (shorter / np.maximum(turn, 1e-12)) ** 2) - gain) / 2
    limit = np.ones(len(points))
    limit[1:-1] = np.where(turn > BEND, np.minimum(1.0, np.sqrt(square)), 1.0)
    limit[0] = limit[-1] = 0.0
    rate = limit.copy()
    for i in range(len(lengths)):
        rate[i + 1] = min(rate[i + 1], np.sqrt(rate[i] ** 2 + 2 * strength[i] * lengths[i]))
    for i in range(len(lengths) - 1, -1, -1):
        rate[i] = min(rate[i], np.sqrt(rate[i + 1] ** 2 + 2 * strength[i] * lengths[i]))
    durations = 2 * lengths / np.maximum(rate[:-1] + rate[1:], 1e-6)
    return np.concatenate([[0.0], np.cumsum(durations)]), points


def sample_times(times: np.ndarray, points: np.ndarray, period: float) -> np.ndarray:
    """Return points (K, D) at every `period` [s], the last one exactly at the end.

    Between points each joint follows a monotone cubic (Fritsch & Carlson 1980): its speed does not jump, and it stays
    between the values of the two points.
    """
    count = int(np.ceil(times[-1] / period - 1e-9))
    sampled_at = np.minimum(np.arange(1, count + 1) * period, times[-1])
    if count == 0:
        return points[-1:]
    rows = PchipInterpolator(times, points, axis=0)(sampled_at)
    rows[-1] = points[-1]
    return np.asarray(rows)

"""Rows of a planned motion as points with velocities, slow enough for what a controller makes between the points.

A controller that is given positions and velocities follows a cubic from each point to the next (JointTrajectory of
ROS 2). Its speed is highest where its acceleration is zero, its acceleration at the ends of a piece, so that both are
known in closed form; times are stretched until they keep the limits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PEAK = 1.5
"""Highest speed of a cubic from rest to rest, over its mean."""
MOVED = 1e-9
"""Joints that change by less between two rows stand still [rad, m]."""


@dataclass(frozen=True)
class Points:
    """A motion: times (N,) [s] from 0, positions and velocities (N, J) [rad, m], and how they came about."""

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    stretch: float
    top_speed: float
    top_acceleration: float


def retime(rows: np.ndarray, period: float, speeds: np.ndarray, accelerations: np.ndarray) -> Points:
    """Return rows (N, J), planned `period` [s] apart, as points that begin and end at rest and keep the limits (J,);
    `accelerations` may be infinite.

    Where the first joints (those with a finite acceleration) stand still, a piece is made longer by itself: fingers
    that close from one row to the next get the time that they need.
    """
    arm = np.isfinite(accelerations)
    steps = np.abs(np.diff(rows, axis=0))
    lengths = np.full(len(steps), period)
    for joint in np.flatnonzero(~arm):
        lengths = np.maximum(lengths, PEAK * steps[:, joint] / speeds[joint])
    times = np.concatenate([[0.0], np.cumsum(lengths)])
    velocities = _velocities(rows, times)
    speed, acceleration = _peaks(rows, times, velocities)
    share = float((speed / speeds).max(initial=0.0))
    harder = float((acceleration[arm] / accelerations[arm]).max(initial=0.0))
    stretch = max(1.0, share, float(np.sqrt(harder)))
    return Points(times * stretch, rows, velocities / stretch, stretch, share / stretch, harder / stretch**2)


def _velocities(rows: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return velocities (N, J): of the parabola through each point and its neighbours, 0 where a joint stands still
    on one side or turns back, and at both ends."""
    velocities = np.zeros_like(rows)
    if len(rows) < 3:
        return velocities
    lengths = np.diff(times)[:, None]
    slopes = np.diff(rows, axis=0) / lengths
    before, after = slopes[:-1], slopes[1:]
    mean = (before * lengths[1:] + after * lengths[:-1]) / (lengths[1:] + lengths[:-1])
    moving = (before * after > 0) & (np.minimum(np.abs(before), np.abs(after)) * lengths[1:] > MOVED)
    velocities[1:-1] = np.where(moving, mean, 0.0)
    return velocities


def _peaks(rows: np.ndarray, times: np.ndarray, velocities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the highest speed and acceleration (J,) of the cubics between the points."""
    if len(rows) < 2:
        return np.zeros(rows.shape[1]), np.zeros(rows.shape[1])
    length = np.diff(times)[:, None]
    slope = np.diff(rows, axis=0) / length
    first, last = velocities[:-1], velocities[1:]
    at_start = (6 * slope - 4 * first - 2 * last) / length
    at_end = (-6 * slope + 2 * first + 4 * last) / length
    with np.errstate(divide="ignore", invalid="ignore"):
        share = at_start / (at_start - at_end)  # of the piece, where the acceleration is zero
    inside = np.isfinite(share) & (share > 0) & (share < 1)
    share = np.where(inside, share, 0.0)
    middle = first + length * (at_start * share + (at_end - at_start) * share**2 / 2)
    speed = np.abs(np.concatenate([velocities, np.where(inside, middle, 0.0)])).max(axis=0)
    acceleration = np.abs(np.concatenate([at_start, at_end])).max(axis=0)
    return speed, acceleration

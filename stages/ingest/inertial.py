"""Which way is up in the world of a log, by its inertial measurements."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2] (CGPM 1901)."""
FEWEST_SAMPLES = 20
"""Fewest samples with a pose from which up is taken; by eye."""
TOLERANCE = 0.1
"""Relative deviation of the mean acceleration from gravity; more means motion, other units, or wrong poses."""


def measured_up(
    samples: Iterable[tuple[int, np.ndarray]], world_from_imu: Callable[[int], np.ndarray | None]
) -> tuple[np.ndarray | None, str]:
    """Return up (3,), unit, in the world of the poses, and a note; None with the reason when it cannot be told.

    `samples` are stamps [ns] with proper accelerations (3,) [m/s^2] (+9.81 along up at rest, REP-145). What the device
    does in between averages out over a recording that begins and ends at similar speed.
    """
    turned, sample_count = [], 0
    for stamp, acceleration in samples:
        sample_count += 1
        if not np.isfinite(acceleration).all():
            continue
        pose = world_from_imu(stamp)
        if pose is not None:
            turned.append(pose[:3, :3] @ acceleration)
    if len(turned) < FEWEST_SAMPLES:
        return None, f"IMU not used for up: {len(turned)} of its {sample_count} samples looked at have a pose"
    mean = np.mean(turned, axis=0)
    norm = float(np.linalg.norm(mean))
    if abs(norm - STANDARD_GRAVITY) > TOLERANCE * STANDARD_GRAVITY:
        return None, f"IMU not used for up: its mean acceleration in the world is {norm:.2f} m/s^2, not 9.81"
    return mean / norm, f"IMU: mean acceleration {norm:.2f} m/s^2 over {len(turned)} samples"

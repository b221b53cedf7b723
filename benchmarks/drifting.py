"""Poses that drift as odometry does: small errors of every step add up."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

TRANSLATION_PER_METRE = 0.01
"""Standard deviation of the position error that a metre of travel adds, per axis [m]."""
ROTATION_PER_METRE = np.radians(0.3)
"""... and of the rotation error [rad]."""


def drifting_poses(world_from_camera: np.ndarray, random: np.random.Generator, factor: float = 1.0) -> np.ndarray:
    """Return poses (N, 4, 4) in which every relative motion has an error that grows with the distance it covers,
    `factor` times that of the constants.

    A random walk: the variance of each step is proportional to its length, turns count as their arc at one metre.
    The first pose is exact.
    """
    result = world_from_camera.astype(float).copy()
    for k in range(1, len(result)):
        step = np.linalg.inv(world_from_camera[k - 1]) @ world_from_camera[k]
        angle = np.linalg.norm(Rotation.from_matrix(step[:3, :3]).as_rotvec())
        spread = factor * np.sqrt(np.linalg.norm(step[:3, 3]) + angle)
        error = np.eye(4)
        error[:3, 3] = random.normal(0.0, TRANSLATION_PER_METRE * spread, 3)
        error[:3, :3] = Rotation.from_rotvec(random.normal(0.0, ROTATION_PER_METRE * spread, 3)).as_matrix()
        result[k] = result[k - 1] @ step @ error
    return result

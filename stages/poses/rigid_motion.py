"""Algebra of relative poses: exponential and logarithm of SE(3), and how far a motion goes.

A twist is (6,): rotation vector [rad] first, then the translation part [m]. Perturbations act from the left,
`exponential(twist) @ pose`.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from stages.kit.geometry.transforms import inverse, transform_from


def skew(vector: np.ndarray) -> np.ndarray:
    """Return the (3, 3) matrix whose product with x is `vector` cross x."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _left_jacobian(rotation_vector: np.ndarray) -> np.ndarray:
    """Return the (3, 3) left Jacobian of SO(3) (Barfoot 2017, eq. 7.77)."""
    angle = float(np.linalg.norm(rotation_vector))
    cross = skew(rotation_vector)
    if angle < 1e-6:
        return np.eye(3) + 0.5 * cross + cross @ cross / 6.0
    return np.eye(3) + (1.0 - np.cos(angle)) / angle**2 * cross + (angle - np.sin(angle)) / angle**3 * (cross @ cross)


def exponential(twist: np.ndarray) -> np.ndarray:
    """Return the (4, 4) rigid motion of a twist (6,)."""
    twist = np.asarray(twist, dtype=float)
    rotation = Rotation.from_rotvec(twist[:3]).as_matrix()
    return transform_from(rotation, _left_jacobian(twist[:3]) @ twist[3:])


def logarithm(motion: np.ndarray) -> np.ndarray:
    """Return the twist (6,) of a rigid motion (4, 4); the inverse of `exponential` for angles below pi."""
    rotation_vector = Rotation.from_matrix(motion[:3, :3]).as_rotvec()
    return np.concatenate([rotation_vector, np.linalg.solve(_left_jacobian(rotation_vector), motion[:3, 3])])


def adjoint(motion: np.ndarray) -> np.ndarray:
    """Return the (6, 6) matrix with exponential(adjoint(T) x) = T exponential(x) T^-1."""
    rotation, translation = motion[:3, :3], motion[:3, 3]
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = rotation
    result[3:, :3] = skew(translation) @ rotation
    return result


def between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return first_from_second (4, 4) of two world_from_x poses."""
    return inverse(first) @ second


def angle_of(motion: np.ndarray) -> float:
    """Return the angle of a motion's rotation [rad] in [0, pi]."""
    return float(np.linalg.norm(Rotation.from_matrix(motion[:3, :3]).as_rotvec()))


def distance_of(motion: np.ndarray) -> float:
    """Return the length of a motion's translation [m]."""
    return float(np.linalg.norm(motion[:3, 3]))


def fraction(motion: np.ndarray, share: float) -> np.ndarray:
    """Return the part of a motion (4, 4) that the same screw has done after `share` of the way."""
    return exponential(share * logarithm(motion))


def orthonormal(motion: np.ndarray) -> np.ndarray:
    """Return the motion with its rotation made orthonormal again after many products."""
    u, _, vt = np.linalg.svd(motion[:3, :3])
    return transform_from(u @ vt, motion[:3, 3])

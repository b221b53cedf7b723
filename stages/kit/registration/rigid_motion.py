"""Algebra of relative poses: exponential and logarithm of SE(3), and how far a motion goes.

A twist is (6,): rotation vector [rad] first, then the translation part [m]. Perturbations act from the left,
`exponential(twist) @ pose`.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scipy.spatial.transform import Rotation


def skew(vector: np.ndarray) -> np.ndarray:
    """Return the (..., 3, 3) matrices whose product with x is `vector` (..., 3) cross x."""
    x, y, z = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)


def _left_jacobian(rotation_vector: np.ndarray) -> np.ndarray:
    """Return the (..., 3, 3) left Jacobians of SO(3) (Barfoot 2017, eq. 7.77)."""
    angle = np.linalg.norm(rotation_vector, axis=-1)[..., None, None]
    cross = skew(rotation_vector)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) + first * cross + second * (cross @ cross)


def exponential(twist: np.ndarray) -> np.ndarray:
    """Return the (..., 4, 4) rigid motions of twists (..., 6)."""
    twist = np.asarray(twist, dtype=float)
    rotation = Rotation.from_rotvec(twist[..., :3].reshape(-1, 3)).as_matrix().reshape(*twist.shape[:-1], 3, 3)
    return _motions(rotation, (_left_jacobian(twist[..., :3]) @ twist[..., 3:, None])[..., 0])


def logarithm(motion: np.ndarray) -> np.ndarray:
    """Return the twists (..., 6) of rigid motions (..., 4, 4); the inverse of `exponential` for angles below pi."""
    rotations = Rotation.from_matrix(motion[..., :3, :3].reshape(-1, 3, 3))
    rotation_vector = rotations.as_rotvec().reshape(*motion.shape[:-2], 3)
    shift = np.linalg.solve(_left_jacobian(rotation_vector), motion[..., :3, 3:])[..., 0]
    return np.concatenate([rotation_vector, shift], axis=-1)


def adjoint(motion: np.ndarray) -> np.ndarray:
    """Return the (..., 6, 6) matrices with exponential(adjoint(T) x) = T exponential(x) T^-1."""
    rotation, translation = motion[..., :3, :3], motion[..., :3, 3]
    result = np.zeros((*motion.shape[:-2], 6, 6))
    result[..., :3, :3] = result[..., 3:, 3:] = rotation
    result[..., 3:, :3] = skew(translation) @ rotation
    return result


def inverses(motions: np.ndarray) -> np.ndarray:
    """Return the inverses of rigid motions (..., 4, 4)."""
    turned = np.swapaxes(motions[..., :3, :3], -1, -2)
    return _motions(turned, -(turned @ motions[..., :3, 3:])[..., 0])


def _motions(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    result = np.zeros((*rotation.shape[:-2], 4, 4))
    result[..., :3, :3], result[..., :3, 3], result[..., 3, 3] = rotation, translation, 1.0
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
    """Return the motions (..., 4, 4) with their rotations made orthonormal again after many products."""
    u, _, vt = np.linalg.svd(motion[..., :3, :3])
    return _motions(u @ vt, motion[..., :3, 3])

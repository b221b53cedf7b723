"""Rigid transforms as (4, 4) float64 arrays named target_from_source; quaternions are x, y, z, w."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation


def transform_from(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Build (4, 4) target_from_source from a (3, 3) rotation and a (3,) translation [m]."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def transform_from_quaternion(quaternion_xyzw: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Build (4, 4) target_from_source from a quaternion (x, y, z, w) and a (3,) translation [m]."""
    return transform_from(Rotation.from_quat(quaternion_xyzw).as_matrix(), translation)


def transform_from_yaw(yaw: float, translation: np.ndarray) -> np.ndarray:
    """Build (4, 4) target_from_source that turns by `yaw` [rad] about z, then shifts by `translation` [m]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return transform_from(np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]), translation)


def quaternion_of(target_from_source: np.ndarray) -> np.ndarray:
    """Return the rotation of a (4, 4) transform as a (4,) quaternion x, y, z, w with w >= 0."""
    return Rotation.from_matrix(target_from_source[:3, :3]).as_quat(canonical=True)


def inverse(target_from_source: np.ndarray) -> np.ndarray:
    """Return source_from_target of a rigid (4, 4) transform."""
    rotation = target_from_source[:3, :3]
    return transform_from(rotation.T, -rotation.T @ target_from_source[:3, 3])


def apply(target_from_source: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Map points (..., 3) from source to target."""
    return points @ target_from_source[:3, :3].T + target_from_source[:3, 3]


def rotation_between(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the (3, 3) smallest rotation that takes direction `source` (3,) to direction `target` (3,)."""
    source = np.asarray(source, dtype=float) / np.linalg.norm(source)
    target = np.asarray(target, dtype=float) / np.linalg.norm(target)
    axis = np.cross(source, target)
    sine, cosine = np.linalg.norm(axis), float(source @ target)
    if sine < 1e-12:
        if cosine > 0:
            return np.eye(3)
        helper = np.eye(3)[np.argmin(np.abs(source))]
        axis = np.cross(source, helper)
        return Rotation.from_rotvec(np.pi * axis / np.linalg.norm(axis)).as_matrix()
    return Rotation.from_rotvec(np.arctan2(sine, cosine) * axis / sine).as_matrix()


def is_rigid(matrix: np.ndarray, tolerance: float = 1e-3) -> bool:
    """Whether a (4, 4) array is finite, orthonormal, right-handed, with last row 0 0 0 1."""
    matrix = np.asarray(matrix, dtype=float)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        return False
    rotation = matrix[:3, :3]
    return bool(
        np.abs(rotation @ rotation.T - np.eye(3)).max() < tolerance
        and np.linalg.det(rotation) > 0
        and np.abs(matrix[3] - [0, 0, 0, 1]).max() < 1e-9
    )


def wrapped(angles: ArrayLike) -> np.ndarray:
    """Return angles [rad] from -pi (inclusive) to pi."""
    return np.asarray((np.asarray(angles) + np.pi) % (2 * np.pi) - np.pi)


def look_at(eye: np.ndarray, target: np.ndarray, up: ArrayLike = (0.0, 0.0, 1.0)) -> np.ndarray:
    """Return world_from_camera (4, 4) of an OpenCV camera at `eye` that looks at `target` [m], image up along `up`."""
    forward = np.asarray(target, dtype=float) - eye
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, np.asarray(up, dtype=float))
    right = right / np.linalg.norm(right)
    down = np.cross(forward, right)
    return transform_from(np.column_stack([right, down, forward]), np.asarray(eye, dtype=float))

"""The usual ways in which poses are meant that we do not mean, turned into ours.

`converted` returns rigid world_from_camera in metres with OpenCV camera axes (x right, y down, z forward). Where the
world's origin is and which of its axes is up is no matter of these conventions: gravity takes care of that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.stages.ingest.pose_convention_names import CONVENTION_WORDS, POSE_CONVENTIONS, PoseConvention
from scipy.spatial.transform import Rotation

__all__ = ["CONVENTION_WORDS", "POSE_CONVENTIONS", "PoseConvention", "converted"]

OPENGL_AXES = np.diag([1.0, -1.0, -1.0, 1.0])
"""Turns the camera axes of OpenCV into those of OpenGL, and back."""
BODY_FROM_OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""REP-103: x forward, y left, z up of a body whose camera looks along x."""
MIRROR_Y = np.diag([1.0, -1.0, 1.0, 1.0])
"""Mirrors y, which makes left-handed poses right-handed."""
W_FIRST = (1, 2, 3, 0)
"""A reader of x y z w was given w x y z: what it calls y is x, z is y, w is z, and x is w."""
W_LAST = (3, 0, 1, 2)
"""A reader of w x y z was given x y z w: what it calls w is x, x is y, y is z, and z is w."""


def converted(poses: np.ndarray, name: PoseConvention, translation_scale: float = 1.0) -> np.ndarray:
    """Return world_from_camera (N, 4, 4) [m] of rigid `poses` (N, 4, 4) that were written in the convention `name`.

    Their translations are first multiplied by `translation_scale` (0.001 when the log has millimetres). Raises
    KeyError for a convention that is not in POSE_CONVENTIONS.
    """
    poses = np.array(poses, dtype=float).reshape(-1, 4, 4)
    poses[:, :3, 3] *= translation_scale
    return _CONVERSIONS[name](poses)


def _inverted(poses: np.ndarray) -> np.ndarray:
    rotations = poses[:, :3, :3].transpose(0, 2, 1)
    return _composed(rotations, -np.einsum("nij,nj->ni", rotations, poses[:, :3, 3]))


def _composed(rotations: np.ndarray, translations: np.ndarray) -> np.ndarray:
    result = np.tile(np.eye(4), (len(rotations), 1, 1))
    result[:, :3, :3] = rotations
    result[:, :3, 3] = translations
    return result


def _reordered(poses: np.ndarray, order: tuple[int, int, int, int]) -> np.ndarray:
    """Take component `order[k]` of the quaternion (x, y, z, w) as component k. The sign of a quaternion is free, and
    stays free, so the matrix is all that is needed."""
    if not len(poses):
        return poses
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()[:, list(order)]
    return _composed(Rotation.from_quat(quaternions).as_matrix(), poses[:, :3, 3])


_CONVERSIONS: dict[PoseConvention, Callable[[np.ndarray], np.ndarray]] = {
    "as-is": lambda poses: poses,
    "inverse": _inverted,
    "opengl": lambda poses: poses @ OPENGL_AXES,
    "inverse-opengl": lambda poses: _inverted(poses) @ OPENGL_AXES,
    "ros-body": lambda poses: poses @ BODY_FROM_OPTICAL,
    "inverse-ros-body": lambda poses: _inverted(poses) @ BODY_FROM_OPTICAL,
    "left-handed": lambda poses: MIRROR_Y @ poses @ MIRROR_Y,
    "quaternion-wxyz": lambda poses: _reordered(poses, W_FIRST),
    "quaternion-xyzw": lambda poses: _reordered(poses, W_LAST),
    "inverse-quaternion-wxyz": lambda poses: _inverted(_reordered(poses, W_FIRST)),
}

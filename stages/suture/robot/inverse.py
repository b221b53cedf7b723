"""Inverse kinematics of the patient-side manipulator in closed form, every branch.

The shaft line, the jaw's link and the wrist-yaw axis lie in one plane through the remote centre (the wrist-pitch axis
is its normal). So the wrist-yaw point and axis give that plane; the link from pitch to yaw lies in it, perpendicular to
the yaw axis, on either side; the shaft may run forwards or backwards through the remote centre; and the first two
joints reach a direction in two ways: eight branches, and whole turns of the roll within its limits.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import wrapped
from scenewright.stages.suture.robot.psm import (
    LOWER,
    PITCH_TO_YAW,
    REMOTE_CENTRE_TO_CARRIAGE,
    TOOL_LENGTH,
    UPPER,
    WRIST_FROM_TIP,
    within_limits,
)

SMALLEST = 1e-9
"""Lengths below this [m] have no direction."""


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    # numpy's own takes several times as long on a few vectors
    x = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    y = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    return np.stack([x, y, a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]], axis=-1)


def branches(base_from_tip: np.ndarray, flips: tuple[bool, ...] = (False, True)) -> np.ndarray:
    """Return joints (..., 8, 6) that put the tip at base_from_tip (..., 4, 4), limits not asked, roll in [-pi, pi).

    `flips` (False,) leaves out the half in which the second joint lies beyond 90 degrees.

    A row is NaN where the wrist-yaw axis passes through the remote centre (the plane is then not determined) or the
    pitch axis comes to lie in it.
    """
    pose = np.asarray(base_from_tip, dtype=float)
    wrist = pose[..., :3, :3] @ WRIST_FROM_TIP[:3, :3].T
    yaw_point = pose[..., :3, 3] - wrist @ WRIST_FROM_TIP[:3, 3]
    yaw_axis = wrist[..., :, 2]
    across = yaw_point - (yaw_point * yaw_axis).sum(-1, keepdims=True) * yaw_axis
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        across = np.where(length > SMALLEST, across / length, np.nan)
        branches = []
        for side in (1.0, -1.0):
            link = side * across
            pitch_point = yaw_point - PITCH_TO_YAW * link
            reach = np.linalg.norm(pitch_point, axis=-1)
            reach = np.where(reach > SMALLEST, reach, np.nan)
            for sign in (1.0, -1.0):
                shaft = sign * pitch_point / reach[..., None]
                for flip in flips:
                    branches.append(_branch(wrist, link, yaw_axis, shaft, sign * reach, flip))
    return np.stack(branches, axis=-2)


def _branch(
    wrist: np.ndarray, link: np.ndarray, yaw_axis: np.ndarray, shaft: np.ndarray, reach: np.ndarray, flip: bool
) -> np.ndarray:
    second = np.arcsin(np.clip(-shaft[..., 1], -1.0, 1.0))
    if flip:
        second = np.pi - second
    sign = np.sign(np.cos(second))
    first = np.arctan2(sign * shaft[..., 0], -sign * shaft[..., 2])
    sine1, cosine1, sine2, cosine2 = np.sin(first), np.cos(first), np.sin(second), np.cos(second)
    # Columns of the third frame, by multiplying out the first three rows of the table.
    shaft_x = np.stack([-sine1 * sine2, -cosine2, cosine1 * sine2], axis=-1)
    shaft_y = _cross(shaft, shaft_x)
    pitch_axis = _cross(link, yaw_axis)
    roll = np.arctan2(-(pitch_axis * shaft_x).sum(-1), (pitch_axis * shaft_y).sum(-1))
    rolled_x = np.cos(roll)[..., None] * shaft_x + np.sin(roll)[..., None] * shaft_y
    pitch = np.arctan2(-(link * shaft).sum(-1), (link * rolled_x).sum(-1)) + np.pi / 2
    jaw_x = wrist[..., :, 0]
    yaw = np.arctan2(-(jaw_x * pitch_axis).sum(-1), (jaw_x * link).sum(-1)) + np.pi / 2
    insertion = reach + REMOTE_CENTRE_TO_CARRIAGE - TOOL_LENGTH
    return np.stack([wrapped(first), wrapped(second), insertion, roll, wrapped(pitch), wrapped(yaw)], axis=-1)


def solutions(base_from_tip: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Return all joints (N, 6) within the limits (less `margin`) for one pose (4, 4), turns of the roll included."""
    rows = branches(base_from_tip)
    rows = rows[np.isfinite(rows).all(axis=-1)]
    turned = [rows + np.eye(6)[3] * 2 * np.pi * turn for turn in (-1, 0, 1)]
    every = np.concatenate(turned)
    return every[within_limits(every, margin)]


def reachable(base_from_tip: np.ndarray) -> np.ndarray:
    """Whether some branch lies within the limits, for poses (..., 4, 4)."""
    rows = branches(base_from_tip, flips=(False,))  # the second joint's limits are far below 90 degrees
    inside = np.ones(rows.shape[:-1], dtype=bool)
    for joint in (0, 1, 2, 4, 5):  # the roll has more than a whole turn, so it never decides
        inside &= (rows[..., joint] >= LOWER[joint]) & (rows[..., joint] <= UPPER[joint])
    return np.asarray(inside.any(axis=-1))


def follow(poses: np.ndarray, start: np.ndarray) -> np.ndarray | None:
    """Return joints (N, 6) along poses (N, 4, 4), each the solution nearest to the one before; None where none is."""
    joints = np.asarray(start, dtype=float)
    path = []
    for pose in poses:
        choices = solutions(pose)
        if not len(choices):
            return None
        joints = choices[np.argmin(np.abs(choices - joints).max(axis=-1))]
        path.append(joints)
    return np.array(path)

"""Patient-side manipulator of the dVRK with the large needle driver: parameters, forward kinematics, Jacobian.

Modified Denavit-Hartenberg rows (Craig) and limits as the dVRK user guide and the dVRK software publish them (joints 1
to 3: `core/share/kinematic/psm.json`; wrist: large needle driver 400006, pitch to yaw 9.1 mm, yaw to control point
10.2 mm, roll +-260 degrees, pitch and yaw +-80 degrees). The base frame has its origin in the remote centre; at rest
the tool points along -z. The tip frame lies at the control point between the jaws: z is where the jaws point, y is
the direction in which they open, x is along the axis about which they turn (wrist yaw).
"""

from __future__ import annotations

import numpy as np

REMOTE_CENTRE_TO_CARRIAGE = 0.4318
"""Distance from the remote centre to the carriage's zero along the tool [m] (`psm.json`)."""
TOOL_LENGTH = 0.4162
"""Length of the tool's shaft [m] (`psm.json`)."""
PITCH_TO_YAW = 0.0091
"""Distance between the wrist's axes [m] (large needle driver 400006)."""
YAW_TO_TIP = 0.0102
"""Distance from the wrist's yaw axis to the control point [m] (large needle driver 400006)."""

ALPHA = np.array([np.pi / 2, -np.pi / 2, np.pi / 2, 0.0, -np.pi / 2, -np.pi / 2])
"""Twist of each row [rad], modified Denavit-Hartenberg."""
LINK_LENGTH = np.array([0.0, 0.0, 0.0, 0.0, 0.0, PITCH_TO_YAW])
"""Link length of each row [m]."""
ANGLE_OFFSET = np.array([np.pi / 2, -np.pi / 2, 0.0, 0.0, -np.pi / 2, -np.pi / 2])
"""Offset of each joint's angle [rad]."""
LINK_OFFSET = np.array([0.0, 0.0, -REMOTE_CENTRE_TO_CARRIAGE, TOOL_LENGTH, 0.0, 0.0])
"""Link offset of each row [m]."""
PRISMATIC = 2
"""Index of the joint that slides."""
LOWER = np.array([-1.588, -0.925025, 0.0, -4.53786, -1.39626, -1.39626])
"""Lower joint limits (6,) [rad], of the insertion [m]."""
UPPER = np.array([1.588, 0.925025, 0.24, 4.53786, 1.39626, 1.39626])
"""Upper joint limits (6,) [rad], of the insertion [m]."""
WRIST_FROM_TIP = np.array(
    [[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, YAW_TO_TIP], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Pose (4, 4) of the tip frame in the frame of the last joint."""


def link_transforms(joints: np.ndarray) -> np.ndarray:
    """Return base_from_link (..., 6, 4, 4) of the six joint frames for joints (..., 6) [rad; third: m]."""
    joints = np.asarray(joints, dtype=float)
    angle = np.broadcast_to(ANGLE_OFFSET, joints.shape).copy()
    offset = np.broadcast_to(LINK_OFFSET, joints.shape).copy()
    revolute = np.arange(6) != PRISMATIC
    angle[..., revolute] += joints[..., revolute]
    offset[..., PRISMATIC] += joints[..., PRISMATIC]
    steps = np.zeros((*joints.shape, 4, 4))
    cosine, sine, ca, sa = np.cos(angle), np.sin(angle), np.cos(ALPHA), np.sin(ALPHA)
    steps[..., 0, 0], steps[..., 0, 1], steps[..., 0, 3] = cosine, -sine, LINK_LENGTH
    steps[..., 1, 0], steps[..., 1, 1], steps[..., 1, 2] = sine * ca, cosine * ca, -sa
    steps[..., 1, 3] = -sa * offset
    steps[..., 2, 0], steps[..., 2, 1], steps[..., 2, 2] = sine * sa, cosine * sa, ca
    steps[..., 2, 3] = ca * offset
    steps[..., 3, 3] = 1.0
    for k in range(1, 6):
        steps[..., k, :, :] = steps[..., k - 1, :, :] @ steps[..., k, :, :]
    return steps


def forward(joints: np.ndarray) -> np.ndarray:
    """Return base_from_tip (..., 4, 4) for joints (..., 6): yaw, pitch, insertion [m], roll, wrist pitch, wrist yaw."""
    return link_transforms(joints)[..., 5, :, :] @ WRIST_FROM_TIP


def jacobian(joints: np.ndarray) -> np.ndarray:
    """Return the geometric Jacobian (6, 6) at joints (6,): rows are the tip's velocity and angular velocity in base."""
    links = link_transforms(joints)
    tip = (links[5] @ WRIST_FROM_TIP)[:3, 3]
    axes = links[:, :3, 2]
    columns = np.zeros((6, 6))
    columns[:3] = np.cross(axes, tip - links[:, :3, 3]).T
    columns[3:] = axes.T
    columns[:3, PRISMATIC], columns[3:, PRISMATIC] = axes[PRISMATIC], 0.0
    return columns


def within_limits(joints: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Whether joints (..., 6) keep `margin` [rad; third: m] from the published limits."""
    return np.asarray(((joints >= LOWER + margin) & (joints <= UPPER - margin)).all(axis=-1))

"""The needle as a rigid half circle: points, tangents, the two poses that a throw plans with.

Needle frame: origin the circle's centre, z its normal, the arc from the tip (angle 0, on +x) to the swage (angle pi).
Leading with the tip means turning about the normal by a negative angle.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.rig import NEEDLE_RADIUS

SAMPLES = 121
"""Points along the needle's arc."""
ARC = np.linspace(0.0, np.pi, SAMPLES)
"""Angle of each point from the tip (0) to the swage (pi) [rad]."""
ARC_POINTS = NEEDLE_RADIUS * np.column_stack([np.cos(ARC), np.sin(ARC), np.zeros(SAMPLES)])
ARC_TANGENTS = np.column_stack([-np.sin(ARC), np.cos(ARC), np.zeros(SAMPLES)])
TIP, SWAGE = ARC_POINTS[0], ARC_POINTS[-1]
"""The needle's two ends (3,) in its own frame [m]."""
UP_THE_WOUND = np.array([0.0, 1.0, 0.0])
"""Direction (3,) along the wound in the world frame."""


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the (3, 3) rotation by `angle` [rad] about a unit axis (3,) (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def turned(pose: np.ndarray, axis: np.ndarray, angle: float, centre: np.ndarray) -> np.ndarray:
    """Return pose (4, 4) turned by `angle` [rad] about the line through `centre` along the unit vector `axis`."""
    rotation = about(axis, angle)
    return transform_from(rotation @ pose[:3, :3], rotation @ (pose[:3, 3] - centre) + centre)


def point_at(pose: np.ndarray, angle: float) -> np.ndarray:
    """Return the point (3,) [m] at an arc angle [rad from the tip] of a needle at `pose` (4, 4)."""
    return pose[:3, 3] + NEEDLE_RADIUS * (np.cos(angle) * pose[:3, 0] + np.sin(angle) * pose[:3, 1])


def upright(centre: np.ndarray, tip_angle: float) -> np.ndarray:
    """Return the pose (4, 4) with the normal along +y and the tip `tip_angle` [rad] past the lowest point, to +x."""
    x_axis = np.array([np.sin(tip_angle), 0.0, -np.cos(tip_angle)])
    return transform_from(np.column_stack([x_axis, np.cross(UP_THE_WOUND, x_axis), UP_THE_WOUND]), centre)


def from_ends(normal: np.ndarray, tip: np.ndarray, swage: np.ndarray) -> np.ndarray:
    """Return the pose (4, 4) of a needle whose normal (3,) and ends (3,) [m] were measured; the normal is trusted."""
    along = tip - swage
    along = along - (along @ normal) * normal
    length = np.linalg.norm(along)
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    x_axis = along / length if length > 1e-6 else np.cross(normal, helper) / np.linalg.norm(np.cross(normal, helper))
    return transform_from(np.column_stack([x_axis, np.cross(normal, x_axis), normal]), (tip + swage) / 2.0)

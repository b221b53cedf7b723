"""Two-finger grasps of upright items: from the side, from above, and tilted between, around the vertical axis."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.acting.hand.grip import FINGER_BAND, FINGER_DEPTH, PITCHES, Grasp, hand_axes
from scenewright.stages.kit.geometry.transforms import apply, inverse

MARGIN = 0.006
"""Room left between the open fingers and the item, both sides together [m]."""
CONTACT_BAND = 0.003
"""Points this near the outermost one are where a finger touches [m]."""
SQUARE = 0.85
"""Least mean cosine between the surface normals there and the closing direction: at a corner fingers slip off."""
ALIGNED = 0.004
"""Headings are as good as the narrowest one when the item is at most this much wider there [m]."""


def sample_grasps(
    points: np.ndarray,
    normals: np.ndarray,
    world_from_body: np.ndarray,
    *,
    opening: float,
    random: np.random.Generator,
    angles: int = 16,
    pitches: tuple[float, ...] = PITCHES,
    heights: tuple[float, ...] = (0.35, 0.5, 0.65, 0.8),
    friction: float = np.inf,
) -> list[Grasp]:
    """Return the grasps whose width fits the gripper and whose fingers meet the surface squarely, in random order.

    `points`, `normals` (N, 3) are of the item's surface, body frame. `opening` [m] is the widest distance of the
    fingers. At each height and tilt those headings are kept where the item is narrowest: on a box they lie flat on its
    faces, on a round item they are all. Where a finger touches, the surface leans by the angle whose tangent is
    `friction` at most: one end of a pad on the near side of a round item squeezes it out of the hand. The list is empty
    when the item is too wide everywhere.
    """
    world_points = apply(world_from_body, points)
    world_normals = normals @ world_from_body[:3, :3].T
    low, high = world_points.min(axis=0), world_points.max(axis=0)
    offset = random.uniform(0, 2 * np.pi / angles)
    headings = np.concatenate([_aligned_headings(world_from_body), offset + 2 * np.pi * np.arange(angles) / angles])
    grasps: list[Grasp] = []
    for pitch in pitches:
        for height in heights if pitch < 1.2 else heights[:1]:
            tried = [
                _grasp_at(world_points, world_normals, low, high, float(heading), pitch, height, opening, friction)
                for heading in headings
            ]
            fitting = [grasp for grasp in tried if grasp is not None]
            narrowest = min((width for _, width in fitting), default=0.0)
            for pose, width in fitting:
                if width < narrowest + ALIGNED:
                    for turned in (pose, pose @ np.diag([-1.0, -1.0, 1.0, 1.0])):
                        grasps.append(Grasp(inverse(world_from_body) @ turned, width, pitch))
    return [grasps[index] for index in random.permutation(len(grasps)).tolist()]


def _square(normals: np.ndarray, out: np.ndarray, friction: float) -> bool:
    """Whether the outside of a surface faces a finger and does not slide along it: normals (N, 3) there, the way out
    (3,), and what the tangent of their angle is at most. The inner side of a thin wall, which faces away, does not
    count."""
    facing = normals @ out
    outside = normals[facing > 0]
    if not len(outside) or float(facing[facing > 0].mean()) < SQUARE:
        return False
    mean = outside.mean(axis=0)
    away = float(mean @ out)
    return float(np.linalg.norm(mean - away * out)) <= friction * away


def _aligned_headings(world_from_body: np.ndarray) -> np.ndarray:
    yaw = np.arctan2(world_from_body[1, 0], world_from_body[0, 0])
    return yaw + np.pi / 2 * np.arange(4)


def _grasp_at(
    points: np.ndarray,
    normals: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    heading: float,
    pitch: float,
    height: float,
    opening: float,
    friction: float,
) -> tuple[np.ndarray, float] | None:
    """Return world_from_tool (4, 4) and the width, or None where the item is too wide or fingers would slip."""
    axes = hand_axes(heading, pitch)
    across, closing, approach = np.ascontiguousarray(axes.T)
    axis_point = np.array([*(low + high)[:2] / 2, low[2] + height * (high[2] - low[2])])
    relative = points - axis_point
    band = np.abs(relative @ across) < FINGER_BAND
    if band.sum() < 8:
        return None
    depth = relative @ approach
    front = float(depth[band].min())
    back = float(depth[band].max())
    tool_depth = front + min((back - front) / 2, FINGER_DEPTH)
    between = band & (depth < tool_depth + FINGER_BAND)
    along = relative[between] @ closing
    width = float(along.max() - along.min())
    if width > opening - MARGIN:
        return None
    touched = normals[between]
    if not _square(touched[along > along.max() - CONTACT_BAND], closing, friction) or not _square(
        touched[along < along.min() + CONTACT_BAND], -closing, friction
    ):
        return None
    pose = np.eye(4)
    pose[:3, :3] = axes
    pose[:3, 3] = axis_point + tool_depth * approach + (along.max() + along.min()) / 2 * closing
    return pose, width

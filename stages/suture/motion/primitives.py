"""Motion primitives as paths of tool poses (K, 4, 4) in the world frame; pure geometry, no simulator.

Orientations are those of the tip frame: z where the jaws point, y in which they open. Jaws open along the wound (y),
so that they close on the needle from both faces of its plane.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.suture.motion.constants import APPROACH_OFFSET, CORRECTION_TURN, EXTRACTION_TURN, INSERTION_TURN
from scenewright.stages.suture.motion.needle import UP_THE_WOUND, turned

STEPS = 20
"""Poses of one motion; by eye."""


def jaws(direction: np.ndarray) -> np.ndarray:
    """Return world_from_tip's rotation (3, 3) for jaws that point along `direction` (3,) and open along y."""
    z_axis = direction / np.linalg.norm(direction)
    y_axis = UP_THE_WOUND - (UP_THE_WOUND @ z_axis) * z_axis
    y_axis = y_axis / np.linalg.norm(y_axis)
    return np.column_stack([np.cross(y_axis, z_axis), y_axis, z_axis])


def straight(start: np.ndarray, end: np.ndarray, steps: int = STEPS) -> np.ndarray:
    """Return poses (steps, 4, 4) from pose to pose: straight in place, about one axis in direction."""
    turn = end[:3, :3] @ start[:3, :3].T
    angle = float(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    length = np.linalg.norm(axis)
    axis = axis / length if length > 1e-9 else UP_THE_WOUND
    share = np.linspace(0.0, 1.0, steps)
    path = np.zeros((steps, 4, 4))
    path[:, :3, :3] = _turns(axis, share * angle) @ start[:3, :3]
    path[:, :3, 3] = start[:3, 3] + share[:, None] * (end[:3, 3] - start[:3, 3])
    path[:, 3, 3] = 1.0
    return path


def _turns(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return rotations (K, 3, 3) by angles (K,) [rad] about a unit axis (3,)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angles)[:, None, None] * cross + (1.0 - np.cos(angles))[:, None, None] * (cross @ cross)


def turning(start: np.ndarray, axis: np.ndarray, angle: float, centre: np.ndarray, steps: int = STEPS) -> np.ndarray:
    """Return poses (steps, 4, 4) of a tool that turns by `angle` [rad] about a line."""
    rotations = _turns(axis, np.linspace(0.0, angle, steps))
    path = np.zeros((steps, 4, 4))
    path[:, :3, :3] = rotations @ start[:3, :3]
    path[:, :3, 3] = rotations @ (start[:3, 3] - centre) + centre
    path[:, 3, 3] = 1.0
    return path


def insertion(start: np.ndarray, vector: np.ndarray, normal: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the tool's path: along the vector (3,) from entry to exit [m], then 45 degrees about the circle normal.

    `centre` is the circle's (3,) [m] before the push. Section 3.2, needle insertion, figure 3.2 (a, b).
    """
    pushed = start.copy()
    pushed[:3, 3] += vector
    return np.concatenate([straight(start, pushed), turning(pushed, normal, -INSERTION_TURN, centre + vector)])


def approach(point: np.ndarray, rotation: np.ndarray, advance: float) -> np.ndarray:
    """Return the path onto a grasp point (3,) [m]: from 1 cm beside it, horizontally, by `advance` [m]."""
    heading = rotation[:, 2] * np.array([1.0, 1.0, 0.0])
    heading = heading / np.linalg.norm(heading)
    start = transform_from(rotation, point - APPROACH_OFFSET * heading)
    end = transform_from(rotation, start[:3, 3] + advance * heading)
    return straight(start, end)


def rotating_out(
    grasp: np.ndarray, normal: np.ndarray, centre: np.ndarray, angle: float = EXTRACTION_TURN
) -> np.ndarray:
    """Return the path of the grasping tool that turns the needle out: 80 degrees about its axis (figure 3.2 e)."""
    return turning(grasp, normal, -angle, centre)


def pull(start: np.ndarray, direction: np.ndarray, length: float) -> np.ndarray:
    """Return a straight path of `length` [m] along a unit direction (3,) without turning."""
    end = start.copy()
    end[:3, 3] += length * direction
    return straight(start, end)


def sweep(suture_exit: np.ndarray, height: float) -> np.ndarray:
    """Return the open left driver's path over the wound towards the cameras, ahead of the needle (figure 3.2 c)."""
    rotation = jaws(np.array([-0.6, 0.0, -0.8]))
    start = transform_from(rotation, suture_exit + np.array([0.006, 0.004, height - suture_exit[2]]))
    end = start.copy()
    end[1, 3] += 0.035
    return straight(start, end)


def normal_to_y(pose: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the tool pose turned in place so that a needle normal (3,) that it holds comes to lie along +y."""
    axis = np.cross(normal, UP_THE_WOUND)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return pose
    return turned(pose, axis / sine, float(np.arctan2(sine, normal @ UP_THE_WOUND)), pose[:3, 3])


def final_turn(pose: np.ndarray, angle: float = CORRECTION_TURN) -> np.ndarray:
    """Return the path of the last step of pose correction: 90 degrees about y, in place (figure 3.2 k)."""
    return turning(pose, UP_THE_WOUND, angle, pose[:3, 3])

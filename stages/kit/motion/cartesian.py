"""Let the tool follow poses: inverse kinematics from each answer to the next, without jumps."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import ArmChain, inverse_kinematics
from scipy.spatial.transform import Rotation, Slerp

LARGEST_JUMP = 0.35
"""A joint that turns more than this [rad] between neighbouring poses has changed to another branch of solutions."""


def straight_poses(start: np.ndarray, end: np.ndarray, step: float = 0.015) -> list[np.ndarray]:
    """Return poses (4, 4) from `start` (excluded) to `end` (included) on a straight line, at most `step` [m] apart."""
    distance = float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
    turn = Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).magnitude()
    count = max(1, int(np.ceil(max(distance / step, turn / 0.08))))
    slerp = Slerp([0.0, 1.0], Rotation.from_matrix(np.array([start[:3, :3], end[:3, :3]])))
    poses = []
    for share in np.arange(1, count + 1) / count:
        pose = np.eye(4)
        pose[:3, :3] = slerp(share).as_matrix()
        pose[:3, 3] = start[:3, 3] + share * (end[:3, 3] - start[:3, 3])
        poses.append(pose)
    return poses


def drawn_back(world_from_tool: np.ndarray, distance: float) -> np.ndarray:
    """Return a tool pose (4, 4) drawn back against the way that the hand points [m]."""
    pose = world_from_tool.copy()
    pose[:3, 3] -= distance * pose[:3, 2]
    return pose


def raised(pose: np.ndarray, height: float) -> np.ndarray:
    """Return a pose (4, 4) so much higher [m]."""
    above = pose.copy()
    above[2, 3] += height
    return above


def follow(chain: ArmChain, base_from_tool: list[np.ndarray], start: np.ndarray) -> np.ndarray:
    """Return arm values (K, J), one per tool pose (4, 4), each solved from the one before, beginning at `start` (J,).

    Raises MotionFailed `no_inverse_kinematics` with the index and errors where the arm cannot follow.
    """
    rows = []
    arm = start
    for index, pose in enumerate(base_from_tool):
        solution = inverse_kinematics(chain, pose, arm[None], iterations=40)
        jump = float(np.abs(solution.arm - arm).max())
        if not solution.found or jump > LARGEST_JUMP:
            raise MotionFailed(
                "no_inverse_kinematics",
                f"the arm cannot follow the tool's path at point {index + 1} of {len(base_from_tool)} "
                f"(nearest {1000 * solution.position_error:.1f} mm, largest joint step {jump:.2f} rad)",
                numbers={
                    "point": index + 1,
                    "points": len(base_from_tool),
                    "distance": solution.position_error,
                    "rotation": solution.rotation_error,
                    "joint_step": jump,
                },
            )
        arm = solution.arm
        rows.append(arm)
    return np.array(rows)

"""Forward and inverse kinematics of a serial arm: numba, damped least squares with restarts.

The inverse is Levenberg-Marquardt on the pose error (Sugihara 2011, IEEE T-RO 27(5): damping proportional to the
squared error), with joint limits kept by clamping; each answer is checked against the tolerance by forward kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.simulation.robot_description import RobotDescription, joints_between
from scenewright.stages.kit.simulation.urdf_split import read_urdf
from scipy.spatial.transform import Rotation

POSITION_TOLERANCE = 1e-4
"""Error of the position at which inverse kinematics ends [m]."""
ROTATION_TOLERANCE = 1e-3
"""Error of the rotation at which inverse kinematics ends [rad]."""
WHOLE_TURN = 2 * np.pi - 1e-6
"""Joints with a range of this [rad] do not end the search at a limit: it goes on from the limit's other side."""


@dataclass(frozen=True)
class ArmChain:
    """A chain of revolute joints that turn about their local z axis."""

    fixed: np.ndarray
    """(J, 4, 4): parent_from_joint of each joint at value 0."""
    tool: np.ndarray
    """(4, 4): last link from tool."""
    lower: np.ndarray
    upper: np.ndarray


@dataclass(frozen=True)
class InverseSolution:
    """The nearest that was found: `arm` (J,), its position [m] and rotation [rad] error, whether within tolerance."""

    arm: np.ndarray
    position_error: float
    rotation_error: float
    found: bool


def arm_chain(robot: RobotDescription) -> ArmChain:
    """Read the chain from the robot's URDF (arm base to tool link); frames of joints whose axis is not z are turned so
    that it is."""
    root = read_urdf(robot.urdf)
    by_name = {joint.get("name"): joint for joint in root.findall("joint")}
    transforms: list[np.ndarray] = []
    pending = np.eye(4)
    for joint in [by_name[name] for name in joints_between(root, robot.arm_base, robot.tool_link)]:
        origin = joint.find("origin")
        offset = np.eye(4)
        if origin is not None:
            offset[:3, 3] = [float(value) for value in origin.get("xyz", "0 0 0").split()]
            angles = [float(value) for value in origin.get("rpy", "0 0 0").split()]
            offset[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
        pending = pending @ offset
        if joint.get("name") in robot.arm_joints:
            element = joint.find("axis")
            axis = [float(value) for value in ("1 0 0" if element is None else element.get("xyz", "1 0 0")).split()]
            turned = _from_z(np.array(axis))
            transforms.append(pending @ turned)
            pending = turned.T
    return ArmChain(np.array(transforms), pending, robot.lower, robot.upper)


def _from_z(axis: np.ndarray) -> np.ndarray:
    """Return a rotation (4, 4) that takes z to an axis (3,)."""
    turned = np.eye(4)
    if not np.array_equal(axis, [0.0, 0.0, 1.0]):
        turned[:3, :3] = Rotation.align_vectors(axis[None], np.array([[0.0, 0.0, 1.0]]))[0].as_matrix()
    return turned


@compiled
def _multiply(first: np.ndarray, second: np.ndarray, out: np.ndarray) -> None:
    for row in range(3):
        for column in range(4):
            total = 0.0
            for k in range(3):
                total += first[row, k] * second[k, column]
            out[row, column] = total
        out[row, 3] += first[row, 3]


@compiled
def _frames(fixed: np.ndarray, tool: np.ndarray, arm: np.ndarray, frames: np.ndarray) -> None:
    """Write base_from_joint of every joint, and base_from_tool last, into `frames` (J + 1, 4, 4)."""
    count = fixed.shape[0]
    pose = np.eye(4)
    turned = np.eye(4)
    for joint in range(count):
        _multiply(pose, fixed[joint], turned)
        sine, cosine = np.sin(arm[joint]), np.cos(arm[joint])
        for row in range(3):
            pose[row, 0] = turned[row, 0] * cosine + turned[row, 1] * sine
            pose[row, 1] = -turned[row, 0] * sine + turned[row, 1] * cosine
            pose[row, 2] = turned[row, 2]
            pose[row, 3] = turned[row, 3]
        frames[joint] = pose
    _multiply(pose, tool, turned)
    frames[count] = turned


@compiled
def _pose_error(current: np.ndarray, target: np.ndarray, error: np.ndarray) -> None:
    """Write the twist (6,) [m, rad] from the current to the target pose, base frame."""
    for row in range(3):
        error[row] = target[row, 3] - current[row, 3]
    relative = np.zeros((3, 3))
    for row in range(3):
        for column in range(3):
            for k in range(3):
                relative[row, column] += target[row, k] * current[column, k]
    x = relative[2, 1] - relative[1, 2]
    y = relative[0, 2] - relative[2, 0]
    z = relative[1, 0] - relative[0, 1]
    sine = 0.5 * np.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (relative[0, 0] + relative[1, 1] + relative[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    if sine > 1e-9:
        factor = 0.5 * angle / sine
        error[3], error[4], error[5] = factor * x, factor * y, factor * z
    elif cosine > 0:
        error[3], error[4], error[5] = 0.5 * x, 0.5 * y, 0.5 * z
    else:
        error[3], error[4], error[5] = np.pi, 0.0, 0.0  # half a turn: any axis leads out of it


@compiled
def _descend(
    fixed: np.ndarray,
    tool: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    target: np.ndarray,
    start: np.ndarray,
    iterations: int,
) -> tuple[np.ndarray, float, float]:
    """Levenberg-Marquardt from one start; return the arm (J,) and its position and rotation error."""
    count = fixed.shape[0]
    frames = np.zeros((count + 1, 4, 4))
    error = np.zeros(6)
    jacobian = np.zeros((6, count))
    arm = start.copy()
    best = arm.copy()
    best_cost = np.inf
    best_position = np.inf
    best_rotation = np.inf
    for _ in range(iterations):
        _frames(fixed, tool, arm, frames)
        _pose_error(frames[count], target, error)
        position = np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        rotation = np.sqrt(error[3] ** 2 + error[4] ** 2 + error[5] ** 2)
        # One radian counts as 0.3 m, about the distance of the wrist from the tool.
        cost = position * position + 0.09 * rotation * rotation
        if cost < best_cost:
            best_cost, best_position, best_rotation = cost, position, rotation
            best[:] = arm
        if position < POSITION_TOLERANCE and rotation < ROTATION_TOLERANCE:
            break
        for joint in range(count):
            ax, ay, az = frames[joint, 0, 2], frames[joint, 1, 2], frames[joint, 2, 2]
            rx = frames[count, 0, 3] - frames[joint, 0, 3]
            ry = frames[count, 1, 3] - frames[joint, 1, 3]
            rz = frames[count, 2, 3] - frames[joint, 2, 3]
            jacobian[0, joint] = ay * rz - az * ry
            jacobian[1, joint] = az * rx - ax * rz
            jacobian[2, joint] = ax * ry - ay * rx
            jacobian[3, joint] = 0.3 * ax
            jacobian[4, joint] = 0.3 * ay
            jacobian[5, joint] = 0.3 * az
        weighted = error.copy()
        weighted[3:] *= 0.3
        # A joint at its limit that the step would push further is left out of the step.
        free = np.ones(count, dtype=np.bool_)
        step = np.zeros(count)
        for _ in range(3):
            normal = np.zeros((6, 6))
            for row in range(6):
                for column in range(6):
                    for joint in range(count):
                        if free[joint]:
                            normal[row, column] += jacobian[row, joint] * jacobian[column, joint]
                normal[row, row] += 0.02 * cost + 1e-6
            multipliers = np.linalg.solve(normal, weighted)
            blocked = False
            for joint in range(count):
                step[joint] = 0.0
                if free[joint]:
                    for row in range(6):
                        step[joint] += jacobian[row, joint] * multipliers[row]
                    at_limit = (arm[joint] <= lower[joint] and step[joint] < 0) or (
                        arm[joint] >= upper[joint] and step[joint] > 0
                    )
                    at_limit = at_limit and upper[joint] - lower[joint] < WHOLE_TURN
                    if at_limit:
                        free[joint] = False
                        blocked = True
            if not blocked:
                break
        longest = np.max(np.abs(step))
        if longest > 0.5:
            step *= 0.5 / longest
        for joint in range(count):
            value = arm[joint] + step[joint]
            if upper[joint] - lower[joint] >= WHOLE_TURN:  # the same place a turn away is within the limits
                value += 2 * np.pi * ((value < lower[joint]) - (value > upper[joint]))
            arm[joint] = min(max(value, lower[joint]), upper[joint])
    return best, best_position, best_rotation


@compiled
def _search(
    fixed: np.ndarray,
    tool: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    target: np.ndarray,
    starts: np.ndarray,
    iterations: int,
) -> tuple[np.ndarray, float, float]:
    best = starts[0].copy()
    best_position, best_rotation = np.inf, np.inf
    for number in range(starts.shape[0]):
        arm, position, rotation = _descend(fixed, tool, lower, upper, target, starts[number], iterations)
        if position + 0.3 * rotation < best_position + 0.3 * best_rotation:
            best, best_position, best_rotation = arm, position, rotation
        if best_position < POSITION_TOLERANCE and best_rotation < ROTATION_TOLERANCE:
            break
    return best, best_position, best_rotation


def forward(chain: ArmChain, arm: np.ndarray) -> np.ndarray:
    """Return base_from_tool (4, 4) of joint values (J,)."""
    frames = np.zeros((len(chain.fixed) + 1, 4, 4))
    frames[:, 3, 3] = 1.0
    _frames(chain.fixed, chain.tool, np.ascontiguousarray(arm, dtype=float), frames)
    frames[-1, 3] = (0, 0, 0, 1)
    return frames[-1]


def shoulder_height(chain: ArmChain) -> float:
    """Return the height [m] of the second joint (the shoulder) over the arm's mounting frame."""
    return float(_shoulder(chain)[2])


def reach(chain: ArmChain) -> float:
    """Return an upper bound of the distance [m] of the tool from where the shoulder's height is on the first axis."""
    beside = np.linalg.norm(_shoulder(chain)[:2])
    offsets = [np.linalg.norm(transform[:3, 3]) for transform in chain.fixed[2:]]
    return float(beside + sum(offsets) + np.linalg.norm(chain.tool[:3, 3]))


def _shoulder(chain: ArmChain) -> np.ndarray:
    shoulder: np.ndarray = (chain.fixed[0] @ chain.fixed[1])[:3, 3]
    return shoulder


def inverse_kinematics(
    chain: ArmChain, base_from_tool: np.ndarray, starts: np.ndarray, *, iterations: int = 60
) -> InverseSolution:
    """Find joint values within the limits for a tool pose (4, 4), tried from each start (S, J) until one converges."""
    arm, position, rotation = _search(
        chain.fixed,
        chain.tool,
        chain.lower,
        chain.upper,
        np.ascontiguousarray(base_from_tool, dtype=float),
        np.ascontiguousarray(np.atleast_2d(starts), dtype=float),
        iterations,
    )
    within = position < POSITION_TOLERANCE and rotation < ROTATION_TOLERANCE
    return InverseSolution(arm, float(position), float(rotation), bool(within))


def random_starts(chain: ArmChain, count: int, random: np.random.Generator) -> np.ndarray:
    """Return (count, J) joint values drawn uniformly within the limits."""
    return random.uniform(chain.lower, chain.upper, size=(count, len(chain.lower)))

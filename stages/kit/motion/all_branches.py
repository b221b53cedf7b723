"""Every branch of the Panda's inverse kinematics, in closed form over its redundant joint.

The last joint is the free one. With its value given, the wrist (where axes 5 and 6 meet) is known; its distance from
the shoulder gives joint 4, the way to the shoulder seen from both sides of joint 5 gives joints 6 and 5, and what is
left is a rotation about z, y, z. Two choices three times: at most eight solutions a value (that the last joint is the
one to fix is from He & Liu 2021, IEEE ICARCV; the derivation is our own). A solution is kept when it lies within the
limits and forward kinematics confirm it. Arms of another build get many compiled restarts instead.
"""

from __future__ import annotations

import numpy as np

from stages.kit.geometry.transforms import wrapped
from stages.kit.motion.kinematics import (
    POSITION_TOLERANCE,
    ROTATION_TOLERANCE,
    ArmChain,
    forward,
    inverse_kinematics,
)

VALUES = 48
"""Values of the last joint that are tried: 0.12 rad apart for the Panda."""
DISTINCT = 0.02
"""Solutions of the restarts nearer to each other than this [rad] are one."""


def all_solutions(
    chain: ArmChain, base_from_tool: np.ndarray, random: np.random.Generator, *, values: int = VALUES
) -> np.ndarray:
    """Return arm values (K, J) within the limits that reach a tool pose (4, 4), in a fixed order; K may be 0.

    For an arm built like the Panda: all branches at `values` values of the last joint. For others: the distinct
    answers of as many restarts, drawn from `random`.
    """
    if panda_lengths(chain) is None:
        return _by_restarts(chain, base_from_tool, random, values)
    candidates = unlimited_solutions(chain, base_from_tool, values=values)
    inside = np.all((candidates >= chain.lower - 1e-9) & (candidates <= chain.upper + 1e-9), axis=1)
    return np.clip(candidates[inside], chain.lower, chain.upper)


def unlimited_solutions(chain: ArmChain, base_from_tool: np.ndarray, *, values: int = VALUES) -> np.ndarray:
    """Return arm values (K, 7) that reach a tool pose (4, 4) whatever the limits of all joints but the last are.

    None are returned for an arm that is not built like the Panda.
    """
    lengths = panda_lengths(chain)
    if lengths is None:
        return np.zeros((0, len(chain.lower)))
    flange = base_from_tool @ np.linalg.inv(chain.tool)
    last = np.linspace(chain.lower[6], chain.upper[6], values)
    candidates = [arm for value in last for arm in _branches(chain.fixed, lengths, flange, float(value))]
    return np.array([arm for arm in candidates if reaches(chain, arm, base_from_tool)]).reshape(-1, 7)


def reaches(chain: ArmChain, arm: np.ndarray, base_from_tool: np.ndarray) -> bool:
    """Whether arm values (J,) put the tool at a pose (4, 4), within the tolerances of inverse kinematics."""
    reached = forward(chain, arm)
    distance = float(np.linalg.norm(reached[:3, 3] - base_from_tool[:3, 3]))
    cosine = (np.trace(reached[:3, :3].T @ base_from_tool[:3, :3]) - 1) / 2
    return distance < POSITION_TOLERANCE and float(np.arccos(np.clip(cosine, -1, 1))) < ROTATION_TOLERANCE


def panda_lengths(chain: ArmChain) -> np.ndarray | None:
    """Return shoulder height, upper arm, elbow offset, forearm, wrist offset (5,) [m]; None for another build."""
    if len(chain.fixed) != 7:
        return None
    fixed = chain.fixed
    lengths = np.array([fixed[0, 2, 3], -fixed[2, 1, 3], fixed[3, 0, 3], fixed[4, 1, 3], fixed[6, 0, 3]])
    model = np.tile(np.eye(4), (7, 1, 1))
    for joint, turn in enumerate((0.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0)):
        if turn:
            model[joint, 1:3, 1:3] = [[0.0, -turn], [turn, 0.0]]
    model[0, 2, 3], model[2, 1, 3], model[3, 0, 3] = lengths[0], -lengths[1], lengths[2]
    model[4, 0, 3], model[4, 1, 3], model[6, 0, 3] = -lengths[2], lengths[3], lengths[4]
    return lengths if np.abs(model - fixed).max() < 1e-6 else None


def _by_restarts(chain: ArmChain, base_from_tool: np.ndarray, random: np.random.Generator, count: int) -> np.ndarray:
    found: list[np.ndarray] = []
    for start in random.uniform(chain.lower, chain.upper, size=(count, len(chain.lower))):
        solution = inverse_kinematics(chain, base_from_tool, start[None])
        if solution.found and all(np.abs(solution.arm - other).max() > DISTINCT for other in found):
            found.append(solution.arm)
    return np.array(found).reshape(-1, len(chain.lower))


def _turn(value: float) -> np.ndarray:
    cosine, sine = np.cos(value), np.sin(value)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _two_angles(cosine: float, sine: float, value: float) -> list[float]:
    """Return the solutions x of cosine * cos(x) + sine * sin(x) = value: none, or two."""
    length = np.hypot(cosine, sine)
    if length < 1e-12 or abs(value) > length:
        return []
    middle, spread = np.arctan2(sine, cosine), np.arccos(value / length)
    return [float(middle + spread), float(middle - spread)]


def _branches(fixed: np.ndarray, lengths: np.ndarray, flange: np.ndarray, last: float) -> list[np.ndarray]:
    """Return all arm values (7,) with the last joint at a value, limits not looked at; frames as in the chain."""
    height, upper, offset, fore, wrist_offset = lengths
    rotation = fixed[:, :3, :3]
    base_from_6 = flange[:3, :3] @ (rotation[6] @ _turn(last)).T
    wrist = flange[:3, 3] - wrist_offset * base_from_6[:, 0]
    to_shoulder = np.array([0.0, 0.0, height]) - wrist
    seen_from_6 = base_from_6.T @ to_shoulder
    # |shoulder - wrist|^2 as a function of joint 4, both in the plane of the elbow.
    constant = upper**2 + fore**2 + 2 * offset**2
    found = []
    for fourth in _two_angles(
        2 * (upper * fore - offset**2), -2 * offset * (fore + upper), float(to_shoulder @ to_shoulder) - constant
    ):
        shoulder_in_3 = np.array([-offset, 0.0, -upper])
        seen_from_4 = (rotation[3] @ _turn(fourth)).T @ shoulder_in_3 - np.array([-offset, fore, 0.0])
        before_5 = rotation[4].T @ seen_from_4
        # The axis of joint 5 is (sin, cos, 0) of joint 6 in frame 6; its share of the way is the same from both sides.
        for sixth in _two_angles(seen_from_6[1], seen_from_6[0], float(before_5[2])):
            base_from_5 = base_from_6 @ (rotation[5] @ _turn(sixth)).T
            after_5 = base_from_5.T @ to_shoulder
            fifth = np.arctan2(before_5[1], before_5[0]) - np.arctan2(after_5[1], after_5[0])
            base_from_4 = base_from_5 @ (rotation[4] @ _turn(fifth)).T
            base_from_3 = base_from_4 @ (rotation[3] @ _turn(fourth)).T
            second = np.arccos(np.clip(base_from_3[2, 2], -1.0, 1.0))
            first = np.arctan2(base_from_3[1, 2], base_from_3[0, 2])
            third = np.arctan2(base_from_3[2, 1], -base_from_3[2, 0])
            for sign, half in ((1, 0.0), (-1, np.pi)):
                angles = [first + half, sign * second, third + half, fourth, fifth, sixth]
                # Joint 6 goes beyond half a turn.
                joints = wrapped(angles)
                joints[5] = joints[5] + 2 * np.pi if joints[5] < -0.5 * np.pi else joints[5]
                found.append(np.array([*joints, last]))
    return found

"""The arm that holds the wrist camera over a surface in front: as the robot's description says, else found."""

from __future__ import annotations

from itertools import product

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.agent.world.physics.beliefs import Beliefs
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.kinematics import ArmChain

HEIGHTS, AHEAD = (1.14, 1.04, 0.94, 0.84, 1.24), (0.36, 0.3, 0.42, 0.24, 0.48)
"""Where the tool point is looked for, over the floor and ahead of the base's middle, the usual place first [m]."""
DOWN = np.pi / 4
"""How far down the hand then points [rad]."""
STARTS = 24
"""Random starts of inverse kinematics for each place."""
MOST_TURN = 2.7
"""Farthest turn of the first joint to either side of ahead [rad]."""
VERTICAL = 0.999
"""Least cosine between the first joint's axis and the vertical."""


def looking_arm(beliefs: Beliefs) -> np.ndarray:
    """Return joint values (J,) with which the arm looks ahead and down. Raises BadInput for an arm that cannot."""
    robot = beliefs.description
    if abs(beliefs.chain.fixed[0][2, 2]) < VERTICAL:
        raise BadInput(
            f"robot {robot.name}: its first joint does not turn about the vertical, so it cannot look around",
            hint="take an arm whose first joint does",
        )
    if robot.look is not None:
        return robot.look
    planner, tally = ArmPlanner(beliefs, np.random.default_rng(11), 0), Tally()
    for height, ahead in product(HEIGHTS, AHEAD):
        arm = planner.free_at(np.zeros(3), _pointing_down(ahead, height), tally, starts=STARTS)
        if arm is not None:
            return arm
    raise BadInput(
        f"robot {robot.name}: no posture has the hand {np.degrees(DOWN):.0f} degrees down, "
        f"{min(AHEAD)} to {max(AHEAD)} m ahead, {min(HEIGHTS)} to {max(HEIGHTS)} m high",
        hint="give its description look = [joint values], or another pedestal_height",
    )


def turned(chain: ArmChain, look: np.ndarray, by: float) -> np.ndarray:
    """Return a looking arm (J,) turned about the vertical by an angle [rad] to the left, or as far as it goes."""
    arm = look.copy()
    arm[0] = look[0] + float(np.sign(chain.fixed[0][2, 2])) * float(np.clip(by, -MOST_TURN, MOST_TURN))
    for whole in (2 * np.pi, -2 * np.pi):
        if not chain.lower[0] <= arm[0] <= chain.upper[0] and chain.lower[0] <= arm[0] + whole <= chain.upper[0]:
            arm[0] += whole
    arm[0] = np.clip(arm[0], chain.lower[0], chain.upper[0])
    return arm


def _pointing_down(ahead: float, height: float) -> np.ndarray:
    """Return world_from_tool (4, 4) of a hand that points ahead and down, the fingers closing to the sides."""
    pose = np.eye(4)
    pose[:3, 2] = [np.cos(DOWN), 0.0, -np.sin(DOWN)]
    pose[:3, 1] = [0.0, -1.0, 0.0]
    pose[:3, 0] = np.cross(pose[:3, 1], pose[:3, 2])
    pose[:3, 3] = [ahead, 0.0, height]
    return pose

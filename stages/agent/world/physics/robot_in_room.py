"""The robot itself: where it is and where it believes to be, its arm by its encoders, what moves it, its clock.

Two frames: the true one, in which pybullet lives, and the map's, which is where localisation says that things are
(`ErringRobot`).
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin

import numpy as np
from scenewright.schemas.errors import UsageError
from scenewright.stages.agent.senses import Base, Felt, FeltKind
from scenewright.stages.agent.world.events import EventLog
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.physics.beliefs import Beliefs, Hold
from scenewright.stages.agent.world.physics.room import Room
from scenewright.stages.kit.acting.erring_robot import ErringRobot
from scenewright.stages.kit.acting.errors import Luck
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import forward
from scenewright.stages.kit.motion.segments import Segment, whole_body
from scenewright.stages.kit.simulation.robot import Configuration, base_pose
from scenewright.stages.kit.simulation.robot_description import RobotDescription, load_robot

TOOL_FROM_CAMERA = np.array([[0, -1, 0, 0.06], [1, 0, 0, 0], [0, 0, 1, -0.1], [0, 0, 0, 1]], float)
"""Pose (4, 4) of the wrist camera in the tool's frame [m]; by eye."""
LOOK_SECONDS = 3.0
"""Time that the arm takes to move to a view [s]. **Assumed.**"""
ROOM_IN_HAND = 0.04
"""What is held may have turned or slid so far between the fingers [m]."""
NEARER = 0.1
"""The arm is shorter than the one of the fast world: it starts so much nearer to a table before it [m]."""


def driving_robot(robot: str) -> RobotDescription:
    """Return the description of a robot. Raises as `load_robot` does, and UsageError for one that does not drive."""
    description = load_robot(robot)
    if not description.drives:
        raise UsageError(
            f"--robot {robot}: it does not drive, and what it is told is all over an apartment",
            hint="give it a base_speed in its description, or take another robot",
        )
    return description


FELT: dict[str, FeltKind] = {
    "no_grasp": "no_grasp",
    "no_inverse_kinematics": "out_of_reach",
    "door_stuck": "door_stuck",
}
"""What planning or control said -> what the robot feels; all else is a motion that was not found."""


def felt(failed: MotionFailed) -> Felt:
    """Return what a motion that failed feels like, with what planning or control said of it."""
    return Felt(False, FELT.get(failed.failure.kind, "no_trajectory"), failed.failure)


class RobotInRoom:
    """Robot and room, with what goes wrong in them (`rates`, `luck`) and the log of it."""

    def __init__(self, room: Room, rates: Rates, seed: int, robot: str) -> None:
        self.room, self.rates, self.luck = room, rates, Luck(seed)
        self.random = np.random.default_rng([seed, 83])
        self.description = driving_robot(robot)
        self.beliefs = Beliefs(self.description)
        x, y, yaw = room.apartment.start
        if any(room.gap(piece, x, y) < 0.5 for piece in room.apartment.furniture):
            x, y = x + NEARER * cos(yaw), y + NEARER * sin(yaw)
        self.believed = np.array([x, y, yaw])
        self.arm = self.description.carry
        start = Configuration(self.believed, self.arm, self.description.opening)
        self.driver = ErringRobot(room.world, self.description, start, 1.0, self.random)
        self.driver.put_arm(self.arm, start.opening)
        self.hold: Hold | None = None
        """What it believes to hold."""
        self.carried: str | None = None
        """What was in its fingers when they closed."""
        self.grasps = 0
        self.log = EventLog()
        self.seconds_aside = self.metres = 0.0

    def close(self) -> None:
        """End the pybullet world of its beliefs."""
        self.beliefs.close()

    @property
    def base(self) -> Base:
        """Where localisation says that the robot stands."""
        return Base(*(float(v) for v in self.believed))

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return self.seconds_aside + self.room.world.time

    def true_base(self) -> np.ndarray:
        """Return where it stands (3,), true frame."""
        return self.driver.robot.configuration().base

    def map_from_true(self) -> np.ndarray:
        """Return the transform (4, 4) of localisation's error."""
        return base_pose(self.believed, self.description) @ inverse(base_pose(self.true_base(), self.description))

    @property
    def home(self) -> np.ndarray:
        """Arm (J,) with which it drives."""
        return self.description.carry if self.hold is None else self.hold.home

    def arm_to(self, arm: np.ndarray) -> None:
        """Bring the arm to joint values; with empty hands it is put there."""
        self.seconds_aside += LOOK_SECONDS
        if self.hold is None:
            self.driver.put_arm(arm, self.driver.robot.configuration().opening)
        else:
            try:
                self._carefully(
                    Segment(whole_body(self.believed, np.array([self.arm, arm])), 0.0, 0.6), self.true_base()
                )
            except MotionFailed:
                arm = self.driver.measured_arm()  # something is in the way: it looks from where it got to
        self.arm = arm

    def draw_in(self) -> None:
        """Draw the arm in after a motion that could not be planned or was stopped, with what it holds."""
        if self.hold is not None:
            self.arm = self.driver.measured_arm()
            self.arm_to(self.home)
            return
        self.arm = self.description.carry
        self.driver.put_arm(self.arm, self.description.opening)

    def _carefully(self, segment: Segment, base: np.ndarray) -> None:
        """Move the arm along a segment; what slips out of the hand is not noticed. Raises MotionFailed
        `path_blocked`."""
        try:
            self.driver.move_arm(segment, base)
        except MotionFailed as failed:
            if failed.failure.kind != "grasp_lost":
                raise

    def carry_out(self, segments: tuple[Segment, ...]) -> None:
        """Follow planned motions of the arm where the base stands. Raises MotionFailed `path_blocked`."""
        base = self.true_base()
        for segment in segments:
            self._carefully(replace(segment, event=""), base)
            self.arm = segment.path[-1, 3:]

    def in_hand(self, points: np.ndarray) -> np.ndarray:
        """Return (N,) bool: points (N, 3) of the map that are of what it believes to hold, or next to it."""
        if self.hold is None:
            return np.zeros(len(points), bool)
        map_from_tool = base_pose(self.believed, self.description) @ forward(self.beliefs.chain, self.arm)
        in_box_frame = apply(inverse(map_from_tool @ self.hold.tool_from_box), points)
        return np.all(np.abs(in_box_frame) < self.hold.size / 2 + ROOM_IN_HAND, axis=1)

    def wrist_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the wrist camera's pose (4, 4) in truth, and in the map by base and encoders."""
        true = self.driver.robot.tool_pose() @ TOOL_FROM_CAMERA
        believed_tool = base_pose(self.believed, self.description) @ forward(self.beliefs.chain, self.arm)
        return true, believed_tool @ TOOL_FROM_CAMERA

"""A robot that does not quite stand where it believes to, in a world that shows it as it is.

Two frames: the map's, in which everything is planned and believed, and the true one, in which pybullet lives. Between
them lies an error that is drawn anew wherever the base comes to a stop. Joints stand a little beside where their
encoders say.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.motion.physical_robot import PhysicalRobot
from scenewright.stages.kit.motion.robot_errors import encoder_errors, stop_error
from scenewright.stages.kit.motion.segments import Segment, whole_body
from scenewright.stages.kit.simulation.robot import Configuration, base_pose
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.world import PhysicsWorld

MOVED = 1e-9
"""Rows whose bases differ by more drive it [m], [rad]."""


class ErringRobot(PhysicalRobot):
    """Takes and returns motions in the map's frame; it knows exactly where it starts."""

    def __init__(
        self,
        world: PhysicsWorld,
        description: RobotDescription,
        start: Configuration,
        record_rate: float,
        random: np.random.Generator,
    ) -> None:
        super().__init__(world, description, start, record_rate)
        self._random = random
        self.encoders = encoder_errors(random, len(start.arm))
        """How the joints stand beside what is told of them (J,) [rad]."""
        self.error = np.zeros(3)
        """What is believed of the base less what is true, as of the last stop."""

    def measured_arm(self) -> np.ndarray:
        """Return the joint values (J,) by the encoders."""
        return self.robot.configuration().arm - self.encoders

    def put_arm(self, arm: np.ndarray, opening: float) -> None:
        """Put the arm at values (J,) by the encoders, where the base stands, and the fingers at an opening [m]."""
        self.put(Configuration(self.robot.configuration().base, arm + self.encoders, opening))

    def move_arm(self, segment: Segment, base: np.ndarray) -> None:
        """Move the arm along a segment as far as its joints tell, the base (3,) truly held. Raises MotionFailed."""
        self.follow_truly(replace(segment, path=whole_body(base, segment.path[:, 3:] + self.encoders)))

    def follow_truly(self, segment: Segment) -> None:
        """Go along a path that is given as it truly leads. Raises MotionFailed."""
        super().follow(segment, None)

    def follow(self, segment: Segment, item: str | None) -> None:
        """Go along a segment's path as far as base and joints tell, then do its event. Raises MotionFailed."""
        path = np.array(segment.path, float)
        rolled = np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1)
        share = np.zeros(len(path))
        before, after = self.error, self.error
        if rolled.sum() > MOVED:
            after = stop_error(self._random)
            share = np.concatenate([[0.0], np.cumsum(rolled) / rolled.sum()])
        path[:, :3] -= before + share[:, None] * (after - before)
        path[:, 3:] += self.encoders
        self.error = after
        super().follow(replace(segment, path=path), item)

    def way_back(self) -> np.ndarray:
        """Return (N, 3 + J) rows, as believed, that go back to where the base came to rest."""
        rows = super().way_back()
        return np.concatenate([rows[:, :3] + self.error, rows[:, 3:] - self.encoders], axis=1)

    def map_from_true(self) -> np.ndarray:
        """Return the transform (4, 4) of localisation's error where the base stands."""
        true = self.robot.configuration().base
        return base_pose(true + self.error, self.description) @ inverse(base_pose(true, self.description))

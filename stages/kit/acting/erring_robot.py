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
from scenewright.stages.kit.motion.segments import Segment
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
        self._encoders = encoder_errors(random, len(start.arm))
        self.error = np.zeros(3)
        """What is believed of the base less what is true, as of the last stop."""

    def believed(self) -> Configuration:
        """Return where base and arm stand by localisation and encoders."""
        true = self.robot.configuration()
        return Configuration(true.base + self.error, true.arm - self._encoders, true.opening)

    def put_as_believed(self, configuration: Configuration) -> None:
        """Put the robot where localisation and encoders say that it stands at a configuration."""
        base, arm = configuration.base - self.error, configuration.arm + self._encoders
        self.put(Configuration(base, arm, configuration.opening))

    def follow(self, segment: Segment, item: str | None) -> None:
        """Go along a segment's path as far as base and joints tell, then do its event. Raises MotionFailed."""
        super().follow(replace(segment, path=self.true_path(segment.path)), item)

    def true_path(self, believed: np.ndarray) -> np.ndarray:
        """Return where a path of base and arm (N, 3 + J) truly leads. What drives ends in a stop with a new error."""
        path = np.array(believed, float)
        rolled = np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1)
        share = np.zeros(len(path))
        before, after = self.error, self.error
        if rolled.sum() > MOVED:
            after = stop_error(self._random)
            share = np.concatenate([[0.0], np.cumsum(rolled) / rolled.sum()])
        path[:, :3] -= before + share[:, None] * (after - before)
        path[:, 3:] += self._encoders
        self.error = after
        return path

    def way_back(self) -> np.ndarray:
        """Return (N, 3 + J) rows, as believed, that go back to where the base came to rest."""
        rows = super().way_back()
        return np.concatenate([rows[:, :3] + self.error, rows[:, 3:] - self._encoders], axis=1)

    def map_from_true(self) -> np.ndarray:
        """Return the transform (4, 4) of localisation's error where the base stands."""
        true = self.robot.configuration().base
        return base_pose(true + self.error, self.description) @ inverse(base_pose(true, self.description))

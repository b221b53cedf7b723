"""A robot that does not quite stand where it believes to, in a world that shows it as it is.

Two frames, as in the physics of `agent`: the map's, in which everything is planned and believed, and the true one, in
which pybullet lives. Between them lies an error that is drawn anew wherever the base comes to a stop.
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
        self._error = np.zeros(3)
        """What is believed of the base less what is true, as of the last stop."""

    def follow(self, segment: Segment, item: str | None) -> None:
        """Go along a segment's path as far as base and joints tell, then do its event. Raises MotionFailed."""
        path = np.array(segment.path, float)
        rolled = np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1)
        share = np.zeros(len(path))
        before, after = self._error, self._error
        if rolled.sum() > MOVED:
            after = stop_error(self._random)
            share = np.concatenate([[0.0], np.cumsum(rolled) / rolled.sum()])
        path[:, :3] -= before + share[:, None] * (after - before)
        path[:, 3:] += self._encoders
        self._error = after
        super().follow(replace(segment, path=path), item)

    def way_back(self) -> np.ndarray:
        """Return (N, 3 + J) rows, as believed, that go back to where the base came to rest."""
        rows = super().way_back()
        return np.concatenate([rows[:, :3] + self._error, rows[:, 3:] - self._encoders], axis=1)

    def map_from_true(self) -> np.ndarray:
        """Return the transform (4, 4) of localisation's error where the base stands."""
        true = self.robot.configuration().base
        return base_pose(true + self._error, self.description) @ inverse(base_pose(true, self.description))

"""A room as a robot believes it, with the robot in it: asked for collisions and motions, nothing moves by physics."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.kinematics import arm_chain
from scenewright.stages.kit.simulation.robot import Configuration, Robot
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.world import PhysicsWorld


class BelievedRoom:
    """Bodies, and a robot that keeps `clearance` [m] from them. A `JointedModel` of kit/motion/arcs.py. Close it.

    Raises BadInput for a body that can't be loaded.
    """

    def __init__(
        self, description: RobotDescription, clearance: float, bodies: Iterable[tuple[SceneBody, str]] = ()
    ) -> None:
        self.description = description
        self.chain = arm_chain(description)
        self.world = PhysicsWorld()
        for record, text in bodies:
            self.world.add_body(record, text)
        self.robot = Robot(self.world, description)
        self.checker = CollisionChecker(self.world, self.robot, clearance)
        self.robot.set(Configuration(np.zeros(3), description.carry, description.opening))

    def close(self) -> None:
        """End the pybullet world."""
        self.world.close()

    def add(self, record: SceneBody, text: str) -> None:
        """Believe in a body more: its record and its URDF text."""
        self.world.add_body(record, text)
        self.checker.add_body(record.name)

    def pose(self, name: str) -> np.ndarray:
        """Return world_from_body (4, 4) of what is believed in."""
        return self.world.pose(name)

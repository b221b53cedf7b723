"""Drawing the arm in with something in the hand."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.kinematics import arm_chain, forward, inverse_kinematics, random_starts
from scenewright.stages.kit.simulation.robot import Configuration, Robot
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.world import PhysicsWorld


class Alone:
    """An arm in an empty room."""

    def __init__(self) -> None:
        self.description = load_robot("panda")
        self.chain = arm_chain(self.description)
        self.world = PhysicsWorld()
        self.checker = CollisionChecker(self.world, Robot(self.world, self.description))


def test_what_a_level_hand_holds_stays_upright_while_the_arm_folds() -> None:
    model = Alone()
    base = np.array([0.3, -0.2, 0.4])
    level = transform_from_yaw(0.0, np.array([0.55, 0.1, 0.4]))
    level[:3, :3] = level[:3, :3] @ np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    start = inverse_kinematics(model.chain, level, random_starts(model.chain, 40, np.random.default_rng(1)))
    assert start.found
    model.checker.robot.set(Configuration(base, start.arm, 0.06))
    planner = ArmPlanner(model, np.random.default_rng(0), 200)
    path = planner.folding(base, start.arm, Tally())
    assert path is not None and np.allclose(path[0], start.arm)
    tools = np.array([forward(model.chain, arm) for arm in path])
    assert np.abs(tools[:, 2, 2]).max() < 0.02, "the hand stays level all the way"
    assert np.hypot(*tools[-1, :2, 3]) < np.hypot(*tools[0, :2, 3]), "and comes nearer"
    model.world.close()

"""The robot in physics: commands, true grasps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.acting.erring_robot import ErringRobot
from scenewright.stages.kit.simulation.robot import Configuration, Robot
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.world import load_scene

from tests.unit.simulation.handmade_scene import bottle, floor, write_scene

PANDA = load_robot("panda")


def test_an_unknown_robot_is_refused_by_name() -> None:
    with pytest.raises(UsageError, match="panda"):
        load_robot("r2d2")


def test_position_control_reaches_base_and_arm_targets(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor()])
    with load_scene(tmp_path) as world:
        robot = Robot(world, PANDA)
        robot.set(Configuration(np.zeros(3), PANDA.carry, 0.08))
        target = np.concatenate([[0.05, -0.03, 0.1], PANDA.carry + 0.1 * np.array([1, 1, -1, 1, 1, -1, 1])])
        robot.command(target, 0.04)
        world.step(480)
        reached = robot.configuration()
        np.testing.assert_allclose(reached.body, target, atol=5e-3)
        assert reached.opening == pytest.approx(0.04, abs=4e-3)


def test_grasp_needs_both_fingers(tmp_path: Path) -> None:
    """The bottle (6 cm) between the fingers is grasped; beside them it is not, and cannot be held."""
    for offset, expected in ((0.0, True), (0.12, False)):
        write_scene(tmp_path, [floor(), bottle(0.0, 0.0, 1.0, "floor_1")])
        with load_scene(tmp_path) as world:
            robot = Robot(world, PANDA)
            robot.set(Configuration(np.zeros(3), PANDA.carry, 0.08))
            tool = robot.tool_pose()
            pose = tool.copy()
            pose[:3, 3] = tool @ np.array([-0.05, offset, 0.0, 1.0]) @ np.eye(4)[:, :3]
            pose[:3, :3] = tool[:3, :3] @ np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
            world.set_pose("bottle_7", pose)
            robot.command(robot.configuration().body, 0.0)
            world.step(60)
            assert robot.grasps("bottle_7") is expected
            if not expected:
                with pytest.raises(ValueError, match="do not grasp"):
                    robot.hold("bottle_7", 50.0)


def test_an_arm_of_six_joints_stands_beside_its_encoders_too(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor()])
    robot = load_robot("ur5e")
    with load_scene(tmp_path) as world:
        start = Configuration(np.zeros(3), robot.carry, robot.opening)
        erring = ErringRobot(world, robot, start, 1.0, np.random.default_rng(0))
        (back,) = erring.way_back()
        assert back.shape == (9,) and 0 < np.abs(back[3:] - robot.carry).max() < 0.05

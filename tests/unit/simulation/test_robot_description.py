"""Robots by description: those of data/robots fit their URDFs and the physics; what is wrong of one is one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.kinematics import (
    arm_chain,
    forward,
    inverse_kinematics,
    random_starts,
    reach,
    shoulder_height,
)
from scenewright.stages.kit.simulation.robot import Configuration, Robot, base_pose
from scenewright.stages.kit.simulation.robot_description import FOLDER, RobotDescription, description_files, load_robot
from scenewright.stages.kit.simulation.world import load_scene

from tests.unit.simulation.handmade_scene import floor, write_scene

NAMES = ("panda", "ur5", "ur5_bench", "kinova_gen3")


@pytest.fixture(params=NAMES)
def robot(request: pytest.FixtureRequest) -> RobotDescription:
    return load_robot(request.param)


def test_kinematics_agree_with_the_physics_and_the_carry_pose_is_free(robot: RobotDescription, tmp_path: Path) -> None:
    write_scene(tmp_path, [floor()])
    chain, random = arm_chain(robot), np.random.default_rng(0)
    with load_scene(tmp_path) as world:
        own = Robot(world, robot)
        checker = CollisionChecker(world, own)
        assert checker.check_meshes(np.concatenate([np.zeros(3), robot.carry])) is None
        for arm in random_starts(chain, 10, random):
            base = random.uniform(-1, 1, 3)
            own.set(Configuration(base, arm, robot.opening))
            expected = own.tool_pose()
            np.testing.assert_allclose(base_pose(base, robot) @ forward(chain, arm), expected, atol=3e-6)
            shoulder = np.array([*base[:2], robot.pedestal_height + shoulder_height(chain)])
            assert np.linalg.norm(expected[:3, 3] - shoulder) < reach(chain)


def test_inverse_kinematics_finds_nearly_all_that_can_be_reached(robot: RobotDescription) -> None:
    chain, random = arm_chain(robot), np.random.default_rng(1)
    found = 0
    for arm in random_starts(chain, 100, random):
        solution = inverse_kinematics(chain, forward(chain, arm), random_starts(chain, 12, random))
        found += solution.found
        assert np.all(solution.arm >= chain.lower) and np.all(solution.arm <= chain.upper)
    assert found >= 96


def test_an_arm_whose_axes_are_not_z_is_the_same_arm(tmp_path: Path) -> None:
    """The UR5 with its wrist's last joint told about -z, in a frame turned by half a turn about x."""
    text = (FOLDER / "ur5.urdf").read_text()
    before = '<origin xyz="0 0 0.09465" rpy="-1.5707963267948966 0.0 0.0"/><axis xyz="0 0 1"/>'
    assert before in text
    (tmp_path / "other.urdf").write_text(text.replace(before, before.replace("0 0 1", "0 0 -1")))
    (tmp_path / "other.toml").write_text('like = "ur5"\nurdf = "other.urdf"\n')
    own, other = arm_chain(load_robot("ur5")), arm_chain(load_robot(str(tmp_path / "other.toml")))
    arm = np.array([0.3, -1.0, 1.2, -0.4, 0.9, 0.7])
    turned = arm * [1, 1, 1, 1, 1, -1]
    np.testing.assert_allclose(forward(other, turned), forward(own, arm), atol=1e-9)


def test_the_files_of_a_description_are_what_a_run_depends_on(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('like = "kinova_gen3"\npedestal_height = 0.6\n')
    named = description_files(str(tmp_path / "own.toml"))
    assert named[:2] == (tmp_path / "own.toml", FOLDER / "kinova_gen3.toml")
    assert load_robot(str(tmp_path / "own.toml")).pedestal_height == 0.6
    assert FOLDER / "kinova_gen3.urdf" in description_files("kinova_gen3")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('like = "r2d2"', "no robot of data/robots"),
        ("speed = 3", "speed: Extra inputs"),
        ('arm_speed = "fast"', "arm_speed: Input should be a valid number"),
        ("arm_speed = nan", "arm_speed"),
        ("arm_forces = [1, 2, 3]", "arm_forces has 3 values for 6 arm joints"),
        ('arm_joints = ["shoulder_joint"]', "arm_joints: Tuple should have at least 6"),
        ("carry = [9, 0, 0, 0, 0, 0]", "lower <= carry <= upper"),
        ('hand_link = "claw"', "no link 'claw'"),
        ('finger_joints = ["left_finger_joint", "flange"]', "joint 'flange' of ur5.urdf is fixed, not prismatic"),
        ('tool_link = "wrist_2"', "not arm_joints in their order"),
        ("name = ", "Invalid value"),
    ],
)
def test_what_is_wrong_of_a_description_is_one_line(tmp_path: Path, change: str, words: str) -> None:
    text = change if change.startswith("like") else f'like = "ur5"\n{change}'
    (tmp_path / "own.toml").write_text(text + "\n")
    with pytest.raises(BadInput, match=words) as caught:
        load_robot(str(tmp_path / "own.toml"))
    assert "\n" not in str(caught.value) and "own.toml" in str(caught.value)

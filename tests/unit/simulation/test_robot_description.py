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
from scipy.spatial.transform import Rotation

from tests.unit.simulation.handmade_scene import floor, write_scene

NAMES = ("panda", "ur5", "ur5_bench", "ur5e", "kinova_gen3", "xarm7")
QUARTER = np.pi / 2
UR5E = (
    (0, 0.1625, QUARTER),
    (-0.425, 0, 0),
    (-0.3922, 0, 0),
    (0, 0.1333, QUARTER),
    (0, 0.0997, -QUARTER),
    (0, 0.0996, 0),
)
"""Standard Denavit-Hartenberg rows (a, d, alpha) of the UR5e, as the maker publishes them."""
XARM7 = (
    *((0, 0.267, -QUARTER), (0, 0, QUARTER), (0.0525, 0.293, QUARTER), (0.0775, 0, QUARTER)),
    *((0, 0.3425, QUARTER), (0.076, 0, -QUARTER), (0, 0.097, 0)),
)
"""The same of the xArm 7: the maker's table of standard rows, while xarm7.urdf is made of that of modified ones."""
FLANGE = 0.163
"""From the flange to between the fingertips [m]."""


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


def flange(rows: tuple[tuple[float, float, float], ...], arm: np.ndarray) -> np.ndarray:
    """Return base_from_flange (4, 4): the product of turns about z and x, with a along x and d along z [m]."""
    pose = np.eye(4)
    for (a, d, alpha), theta in zip(rows, arm, strict=True):
        step = np.eye(4)
        step[:3, :3] = Rotation.from_euler("ZX", [theta, alpha]).as_matrix()
        step[:3, 3] = [a * np.cos(theta), a * np.sin(theta), d]
        pose = pose @ step
    return pose


@pytest.mark.parametrize(("name", "rows"), [("ur5e", UR5E), ("xarm7", XARM7)])
def test_forward_kinematics_are_the_published_ones(name: str, rows: tuple[tuple[float, float, float], ...]) -> None:
    chain = arm_chain(load_robot(name))
    beyond = np.eye(4)
    beyond[2, 3] = FLANGE
    arms = random_starts(chain, 20, np.random.default_rng(3))
    for arm in (np.zeros(len(rows)), load_robot(name).carry, *arms):
        np.testing.assert_allclose(forward(chain, arm), flange(rows, arm) @ beyond, atol=1e-9)


def test_known_places_of_the_flange() -> None:
    """Stretched out at zero the UR5e's flange is at (-a2 - a3, -d4 - d6, d1 - d5), the xArm's at its own zero."""
    down = np.array([0.0, 0.0, FLANGE])
    ur5e = forward(arm_chain(load_robot("ur5e")), np.zeros(6))
    np.testing.assert_allclose(ur5e[:3, 3] - ur5e[:3, :3] @ down, [-0.8172, -0.2329, 0.0628], atol=1e-9)
    xarm7 = forward(arm_chain(load_robot("xarm7")), np.zeros(7))
    np.testing.assert_allclose(xarm7[:3, 3] - xarm7[:3, :3] @ down, [0.206, 0.0, 0.1205], atol=1e-9)


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
    assert named == (tmp_path / "own.toml", FOLDER / "kinova_gen3.toml", FOLDER / "kinova_gen3.urdf")
    assert load_robot(str(tmp_path / "own.toml")).pedestal_height == 0.6
    (tmp_path / "own.toml").write_text('like = "ur5e"\npedestal_height = 0.6\n')
    files = description_files(str(tmp_path / "own.toml"))
    assert files[1:] == tuple(FOLDER / name for name in ("ur5e.toml", "ur5.toml", "ur5e.urdf"))
    assert load_robot(str(tmp_path / "own.toml")).urdf == FOLDER / "ur5e.urdf"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('like = "r2d2"', "no other robot of data/robots"),
        ("speed = 3", "speed: Extra inputs"),
        ('arm_speed = "fast"', "arm_speed: Input should be a valid number"),
        ("arm_speed = nan", "arm_speed"),
        ("arm_forces = [1, 2, 3]", "arm_forces has 3 values for 6 arm joints"),
        ('arm_joints = ["shoulder_joint"]', "arm_joints names 1; an arm here has 6 or 7"),
        ("carry = [9, 0, 0, 0, 0, 0]", "carry 9 is outside its limits"),
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

"""`scenewright robot check`: what it measures of robots whose measures are known, and what it says of broken ones."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scenewright.cli.main import run
from scenewright.stages.kit.simulation.robot_description import FOLDER, RobotDescription, load_robot
from scenewright.stages.plan import robot_check
from scenewright.stages.plan.robot_check import RobotReport, check_robot, urdf_faults
from scenewright.stages.plan.robot_picture import draw_robot_check

UR5 = (FOLDER / "ur5.urdf").read_text()


@pytest.fixture(scope="module")
def ur5e() -> tuple[RobotDescription, RobotReport]:
    robot = load_robot("ur5e")
    return robot, check_robot(robot)


def own(folder: Path, said: str = "", urdf: str = UR5) -> Path:
    """Write a description like the UR5's beside a URDF, and return it."""
    (folder / "own.urdf").write_text(urdf)
    (folder / "own.toml").write_text(f'like = "ur5"\nurdf = "own.urdf"\n{said}\n')
    return folder / "own.toml"


def test_reach_gripper_and_limits_are_the_makers(ur5e: tuple[RobotDescription, RobotReport]) -> None:
    _, report = ur5e
    assert report.problems == [] and report.home == "" and [j.force for j in report.joints] == [150] * 3 + [28] * 3
    assert (report.gripper.opening, report.gripper.closes_along) == (0.085, "y")
    assert report.gripper.palm_behind == pytest.approx(0.163) and report.gripper.gap_shut == pytest.approx(
        0.0, abs=1e-6
    )
    # stretched out level, the wrist is a2 + a3 from the shoulder; the tool hangs d5 beside it and d4 aside
    farthest = np.hypot(0.425 + 0.3922 + 0.0997, 0.1333)
    assert farthest - 0.06 < report.reach.radii[1] <= farthest
    assert 0.0 < report.colliding < 0.9 and sum(report.pairs.values()) == round(report.colliding * robot_check.SAMPLES)


def test_the_picture_is_the_same_every_time(ur5e: tuple[RobotDescription, RobotReport], tmp_path: Path) -> None:
    draw_robot_check(tmp_path / "a.png", *ur5e)
    draw_robot_check(tmp_path / "b.png", *ur5e)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert Image.open(tmp_path / "a.png").width > 600


def test_the_command_prints_lines_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_check, "UP_STEP", 0.4)
    monkeypatch.setattr(robot_check, "OUT_STEP", 0.3)
    assert run(["robot", "check", "xarm7", "--out", str(tmp_path / "picture")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "xarm7: joint2: -2.059 to 2.094 rad (-118 to 120 degrees), 1.5 rad/s, 50 N m" in lines
    assert lines[-1] == "xarm7: sound" and (tmp_path / "picture" / "robot.png").is_file()
    assert run(["robot", "check", "xarm7", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["sound"] and said["home"] == "free" and said["gripper"]["closes_along"] == "y"


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("carry = [0.0, 0.0, 3.0, 0.0, 0.0, 0.0]", "home (carry): "),
        ("opening = 0.2", "opening 0.2 m is above what the finger joints go: 0.085 m"),
        ("arm_speed = 4.0", "arm_speed 4 rad/s is above the URDF's 3.14159"),
        ("lower = [-7, -3.14, -3.14, -3.14, -3.14, -3.14]", "-7 to 3.14159 rad is wider than the URDF's"),
    ],
)
def test_problems_of_a_description_are_one_line_each(
    said: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(robot_check, "UP_STEP", 0.4)
    monkeypatch.setattr(robot_check, "OUT_STEP", 0.3)
    assert run(["robot", "check", str(own(tmp_path, said))]) == 3
    problems = [line for line in capsys.readouterr().out.splitlines() if ": problem: " in line]
    assert any(words in line for line in problems)


TOOL = '<origin xyz="0 0 0.163" rpy="0.0 0.0 0.0"/></joint>\n  <link name="tool">'
FINGER = '<axis xyz="0 -1 0"/>'


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (TOOL, TOOL.replace("0.0 0.0 0.0", "0 0 1.5707963"), "close along x of tool: turn that frame so that it is y"),
        (TOOL, TOOL.replace("0.0 0.0 0.0", "3.14159265 0 0"), "hand is not behind tool: its z points out of the hand"),
        (FINGER, '<axis xyz="0 1 0"/>', "the fingers are 0 mm further apart than shut"),
    ],
)
def test_a_wrong_frame_of_the_gripper_is_said(
    before: str, after: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_check, "UP_STEP", 0.4)
    monkeypatch.setattr(robot_check, "OUT_STEP", 0.3)
    assert before in UR5
    robot = load_robot(str(own(tmp_path, urdf=UR5.replace(before, after))))
    assert any(words in problem for problem in check_robot(robot).problems)


def test_a_urdf_with_faults_is_said_before_physics_loads_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = UR5.replace('<mass value="8.393"/>', '<mass value="-1"/>').replace(
        '<cylinder radius="0.06" length="0.178"/>', '<mesh filename="package://here/part.stl"/>', 1
    )
    file = own(tmp_path, urdf=text)
    assert len(urdf_faults(load_robot(str(file)))) == 2
    assert run(["robot", "check", str(file)]) == 3
    lines = capsys.readouterr().out.splitlines()
    assert lines == [
        "ur5: problem: own.urdf: link 'upper_arm': mass is -1 kg",
        "ur5: problem: own.urdf: mesh 'package://here/part.stl' does not exist",
    ]


LINKAGE = '<joint name="second" type="fixed"><parent link="base"/><child link="forearm"/></joint></robot>'


@pytest.mark.parametrize(
    ("said", "urdf", "words"),
    [
        ('arm_joints = ["a", "b", "c", "d", "e"]', UR5, "arm_joints names 5; an arm here has 6 or 7 joints"),
        ("finger_joints = []", UR5, "finger_joints names 0; a parallel gripper has 2 sliding joints"),
        ("upper = [-4, 3, 3, 3, 3, 3]", UR5, "joint 'shoulder_joint': lower -3.14159 is not below upper -4"),
        ("lower = [-180, -180, -180, -180, -180, -180]", UR5, "lower says -180, which looks like degrees"),
        ("carry = [0, -90, 90, 0, 0, 0]", UR5, "carry says -90, which looks like degrees"),
        ("arm_speed = 180", UR5, "arm_speed says 180, which looks like degrees"),
        ("", UR5.replace("</robot>", LINKAGE), "link 'forearm' of own.urdf hangs from 2 joints: the arm is not serial"),
        (
            "",
            UR5.replace('<box size="0.022 0.007 0.045"/>', '<mesh filename="finger.stl"/>'),
            "own.urdf: mesh 'finger.stl' is not there",
        ),
        ("", UR5.replace('type="prismatic"', 'type="revolute"'), "is revolute, not prismatic"),
        ('arm_base = "wrist_3"\ntool_link = "base"', UR5, "'base' does not hang from 'wrist_3'"),
        (
            "",
            UR5.replace("</robot>", '<xacro:arm xmlns:xacro="http://www.ros.org/wiki/xacro"/></robot>'),
            "own.urdf is xacro, not URDF (expand it first",
        ),
        ("", "<robot", "own.urdf"),
        (
            "",
            UR5.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', 1),
            "'shoulder_joint' of own.urdf: its axis has no",
        ),
        ("", UR5.replace('xyz="0 0 0.089159"', 'xyz="0 0"'), "joint 'upper_arm_joint': origin xyz: '0 0' is not 3"),
    ],
)
def test_what_is_no_robot_is_one_line(
    said: str, urdf: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["robot", "check", str(own(tmp_path, said, urdf))]) == 3
    done = capsys.readouterr()
    (error,) = [line for line in done.err.splitlines() if line.startswith("error:")]
    assert words in error and done.out == ""


def test_a_description_that_says_little_or_names_a_urdf_elsewhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.toml").write_text('name = "mine"\nurdf = "own.urdf"\n')
    assert run(["robot", "check", str(tmp_path / "own.toml")]) == 3
    assert "does not say arm_base, arm_joints, finger_joints" in capsys.readouterr().err
    (tmp_path / "below").mkdir()
    shutil.copy(FOLDER / "ur5.urdf", tmp_path / "own.urdf")
    for name in ("../own.urdf", str(tmp_path / "own.urdf")):
        (tmp_path / "below" / "own.toml").write_text(f'like = "ur5"\nurdf = "{name}"\n')
        assert run(["robot", "check", str(tmp_path / "below" / "own.toml")]) == 3
        assert "is outside the folder of the description" in capsys.readouterr().err
    assert run(["robot", "check", str(tmp_path / "own.urdf")]) == 2
    assert "a URDF says too little of a robot" in capsys.readouterr().err
    assert run(["robot", "check", "r2d2"]) == 2

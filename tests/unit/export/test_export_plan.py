"""A plan's motions as joint trajectories: within limits between points too, read back by others, named as planned."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from scenewright.cli.main import run
from scenewright.schemas.base import as_transform
from scenewright.schemas.exported_trajectory import STATEMENT, TrajectoryExportFile
from scenewright.schemas.plan import PlanFile, PlannedAction
from scenewright.stages.export.retiming import Points, retime
from scenewright.stages.kit.motion.timing import sample_times, time_path
from scipy.interpolate import CubicHermiteSpline
from yaml import safe_load

from tests.unit.viewing.artifacts import seal

PERIOD, OPEN = 0.05, 0.0425
SPEED, ACCELERATION = np.array([1.5] * 7 + [0.15] * 2), np.array([4.0] * 7 + [np.inf] * 2)
REACHED = np.array([0.9, -0.4, 0.3, 1.2, -0.2, 0.6, 1.0])


def reaching() -> np.ndarray:
    """Rows (N, 9) of an arm that reaches with open fingers, shuts them, and goes back, as `plan` writes them."""
    path = np.array([np.zeros(7), 0.6 * REACHED + [0.2, 0, 0, 0, 0, 0, 0], REACHED])
    there = np.concatenate([path[:1], sample_times(*time_path(path, SPEED[:7], ACCELERATION[:7]), PERIOD)])
    rows = np.concatenate([there, np.tile(there[-1], (12, 1)), there[::-1]])
    fingers = np.where(np.arange(len(rows)) < len(there), OPEN, 0.0)
    return np.column_stack([rows, fingers, fingers])


def fastest(points: Points) -> tuple[np.ndarray, np.ndarray]:
    """Return the highest speed and acceleration (J,) of what a controller makes of points, on a fine grid."""
    curve = CubicHermiteSpline(points.times, points.positions, points.velocities)
    grid = np.linspace(0, points.times[-1], 20001)
    return np.abs(curve(grid, 1)).max(axis=0), np.abs(curve(grid, 2)).max(axis=0)


def test_what_a_controller_makes_of_the_points_keeps_the_limits() -> None:
    rows = reaching()
    points = retime(rows, PERIOD, SPEED, ACCELERATION)
    speed, acceleration = fastest(points)
    assert np.all(speed <= SPEED * (1 + 1e-6)) and np.all(acceleration[:7] <= ACCELERATION[:7] * (1 + 1e-6))
    assert points.top_speed == pytest.approx((speed / SPEED).max(), abs=2e-3)
    assert points.top_acceleration == pytest.approx((acceleration[:7] / ACCELERATION[:7]).max(), abs=2e-2)
    assert points.top_acceleration > 0.95 and 1.0 < points.stretch < 2.0
    np.testing.assert_array_equal(points.positions, rows)
    assert np.all(points.velocities[[0, -1]] == 0) and np.all(np.diff(points.times) > 0)


def test_fingers_that_shut_between_two_rows_get_the_time_that_they_need() -> None:
    rows = np.zeros((4, 9))
    rows[:2, 7:] = OPEN
    points = retime(rows, PERIOD, SPEED, ACCELERATION)
    assert points.stretch == 1.0
    np.testing.assert_allclose(np.diff(points.times), [PERIOD, 1.5 * OPEN / 0.15, PERIOD])
    assert fastest(points)[0][7] == pytest.approx(0.15)


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    return write_plan(tmp_path)


def write_plan(folder: Path) -> Path:
    """Write two actions of an xArm: it drives with shut fingers, then reaches with open ones."""
    root = folder / "plan"
    root.mkdir()
    moved = reaching()
    still = np.zeros((10, 9))
    bases = np.tile(np.eye(4), (len(still) + len(moved), 1, 1))
    bases[:10, 0, 3], bases[10:, 0, 3] = np.linspace(0, 0.2, 10), 0.2
    joints = np.concatenate([still, moved])
    time = PERIOD * np.arange(len(joints))
    np.savez(root / "trajectory.npz", time=time, joints=joints, world_from_base=bases, action=np.zeros(len(joints)))
    pose = as_transform(np.eye(4))
    actions = (
        PlannedAction(name="drive", arguments=("start", "cup_5"), start=0, end=10, base_pose=pose),
        PlannedAction(name="pick", arguments=("cup_5",), start=10, end=len(joints), base_pose=pose),
    )
    PlanFile(
        goal=("holding(cup_5)",), planned_in="reconstructed", executed_in=None, actions=actions, status="planned"
    ).write(root / "plan.json")
    (root / "graph.json").write_text('{"nodes": [], "links": []}')
    return seal(root, "plan")


def test_a_plan_leaves_as_yaml_bag_and_csv(plan: Path, tmp_path: Path) -> None:
    plan_manifest(plan, "xarm7")
    out = tmp_path / "out"
    assert run(["export", "plan", "--plan", str(plan), "--robot", "xarm7", "--out", str(out), "--quiet"]) == 0
    info = TrajectoryExportFile.read(out / "export.json")
    assert info.statement == STATEMENT and info.robot == "xarm7" and len(info.joints) == 9
    drive, pick = info.motions
    assert (drive.name, drive.base_moves, pick.base_moves) == ("drive(start, cup_5)", True, False)
    assert pick.start == pytest.approx(drive.seconds) and 0 < pick.top_speed <= 1 and 0.95 < pick.top_acceleration <= 1

    text = (out / pick.file).read_text()
    assert "not run on hardware" in text.splitlines()[0]
    message = safe_load(text)
    assert message["joint_names"] == list(info.joints) and len(message["points"]) == pick.points
    first, last = message["points"][0], message["points"][-1]
    assert first["positions"][7:] == [0.0, 0.0]  # where the drive left the fingers
    stamp = last["time_from_start"]
    assert stamp["sec"] + 1e-9 * stamp["nanosec"] == pytest.approx(pick.seconds, abs=1e-6)

    with (out / "trajectory.mcap").open("rb") as file:
        read = list(make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    trajectories = [message for _, channel, _, message in read if channel.topic == "/joint_trajectory"]
    assert [len(t.points) for t in trajectories] == [drive.points, pick.points]
    np.testing.assert_allclose(trajectories[1].points[-1].positions, last["positions"], atol=1e-6)
    assert any("not run on hardware" in m.data for _, channel, _, m in read if channel.topic == "/action")
    (path, _) = [m for _, channel, _, m in read if channel.topic == "/base_path"]
    assert path.poses[-1].pose.position.x == pytest.approx(0.2)

    lines = (out / "trajectory.csv").read_text().splitlines()
    assert lines[0].startswith("# planned in simulation; not run on hardware")
    rows = list(csv.DictReader(lines[1:]))
    assert len(rows) == drive.points + pick.points and rows[-1]["name"] == "pick(cup_5)"
    assert float(rows[-1]["time"]) == pytest.approx(pick.start + pick.seconds, abs=1e-5)


def plan_manifest(plan: Path, robot: str) -> None:
    """Let the plan's manifest say that it was planned for a robot."""
    from scenewright.schemas.manifest import MANIFEST_NAME, Manifest

    manifest = Manifest.read(plan / MANIFEST_NAME)
    manifest.model_copy(update={"parameters": {"robot": robot}}).write(plan / MANIFEST_NAME)


def test_a_plan_of_another_robot_is_refused(plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan_manifest(plan, "xarm7")
    words = ["export", "plan", "--plan", str(plan), "--out", str(tmp_path / "out"), "--quiet"]
    assert run(words) == 3
    assert "planned for --robot xarm7, not for panda (give --robot xarm7)" in capsys.readouterr().err
    assert run([*words, "--robot", "r2d2"]) == 2
    assert not (tmp_path / "out").exists()
    plan_manifest(plan, "ur5e")
    assert run([*words, "--robot", "ur5e"]) == 3
    assert "rows of 9 joints, the robot ur5e has 8" in capsys.readouterr().err

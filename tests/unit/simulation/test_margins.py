"""Margins: how far what physics says is from being otherwise."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.simulation.margins import LARGEST, SHIFT, TURN, margin, perturbed
from scenewright.stages.urdf.settle_margins import with_margins
from scenewright.stages.urdf.settle_report import SettleReport, settle_file, settle_report
from scipy.spatial.transform import Rotation

from tests.unit.simulation.handmade_scene import HandmadeBody, bottle, floor, kitchen, write_scene


def judged(folder: Path, bodies: list[HandmadeBody]) -> SettleReport:
    write_scene(folder, bodies)
    return with_margins(settle_report(folder, 1.0), folder)


def test_a_margin_is_a_distance_in_standard_deviations() -> None:
    assert margin(3.0, 1.0, [2.0, 4.0]) == pytest.approx(2.0 / np.sqrt(2.0))
    assert margin(1.0, 1.0, [0.9, 1.1]) == 0.0
    assert margin(0.0, 1.0, [0.0, 0.0]) == LARGEST == margin(0.0, 1e6, [0.0, 1e-3])


def test_a_perturbed_pose_is_near_and_not_the_same() -> None:
    pose = transform_from_yaw(0.4, np.array([1.0, 2.0, 3.0]))
    random = np.random.default_rng(1)
    near = [perturbed(pose, random) for _ in range(2)]
    for other in near:
        assert np.linalg.norm(other[:3, 3] - pose[:3, 3]) == pytest.approx(SHIFT)
        assert Rotation.from_matrix(other[:3, :3] @ pose[:3, :3].T).magnitude() == pytest.approx(TURN, rel=1e-6)
    assert not np.allclose(near[0], near[1], atol=1e-6)


def test_what_is_far_from_its_threshold_has_no_margin(tmp_path: Path) -> None:
    report = judged(tmp_path, kitchen(0.0))
    assert report.margins == {} and report.margin is None and not report.marginal
    assert {"margin", "margins"} & set(json.loads(settle_file(report).model_dump_json())) == set()


@pytest.mark.parametrize(("height", "marginal"), [(0.00997, True), (0.0094, False), (0.0106, False)])
def test_what_drops_by_as_much_as_it_may_is_marginal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], height: float, marginal: bool
) -> None:
    report = judged(tmp_path, [floor(), bottle(0.0, 0.0, height, "floor_1")])
    assert list(report.margins) == ["bottle_7"] and report.settled == (height < 0.01)
    assert report.margin == report.margins["bottle_7"] and bool(report.marginal) == marginal
    assert settle_file(report).margins == {"bottle_7": pytest.approx(report.margin, abs=0.01)}
    run(["urdf", "settle", str(tmp_path), "--seconds", "1"])
    assert ("marginal" in capfd.readouterr().out) == marginal


@pytest.mark.parametrize(("deep", "marginal"), [(0.00495, True), (0.00505, True), (0.0044, False)])
def test_what_lies_in_a_drawer_by_as_much_as_it_may_is_marginal(tmp_path: Path, deep: float, marginal: bool) -> None:
    chest = HandmadeBody(
        "chest_2",
        "cabinet",
        np.eye(4),
        [((0, 0.05, 0.5), (0.4, 0.4, 0.1))],
        "floor_1",
        door=[((0, -0.2, 0.7), (0.4, 0.2, 0.2))],
        door_axis=(0, -1, 0),
        door_upper=0.4,
        door_type="prismatic",
    )
    pose = transform_from_yaw(0.0, np.array([0.7 - deep, -0.5, 0.7]))
    report = judged(
        tmp_path, [floor(), chest, HandmadeBody("block_3", "cabinet", pose, [((0, 0, 0), (1, 1, 0.2))], "floor_1")]
    )
    (joint,) = report.joints
    assert joint.start_depth == pytest.approx(deep, abs=1e-5) and joint.free_at_start == (deep < 0.005)
    assert joint.margin is not None and (joint.margin < 2.0) == marginal
    assert joint.joint in report.marginal or not marginal

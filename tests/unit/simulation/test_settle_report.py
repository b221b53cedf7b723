"""The settle test against scenes whose outcome is known beforehand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.urdf.settle_report import SettleReport, settle_report

from tests.unit.simulation.handmade_scene import HandmadeBody, bottle, floor, fridge, kitchen, table, write_scene


def block(name: str, center: tuple[float, float, float], size: tuple[float, float, float]) -> HandmadeBody:
    """A box that stands still."""
    x, y, z = center
    pose = transform_from_yaw(0.0, np.array([x, y, z]))
    return HandmadeBody(name, "cabinet", pose, [((0, 0, 0), size)], "floor_1")


def drawer(door_upper: float = 0.4) -> HandmadeBody:
    """A chest with one drawer that opens along -y from y = -0.3, 0.4 m wide and 0.2 m high."""
    return HandmadeBody(
        "chest_2",
        "cabinet",
        np.eye(4),
        [((0, 0.05, 0.5), (0.4, 0.4, 0.1))],
        "floor_1",
        door=[((0, -0.2, 0.7), (0.4, 0.2, 0.2))],
        door_axis=(0, -1, 0),
        door_upper=door_upper,
        door_type="prismatic",
    )


def report_of(folder: Path, bodies: list[HandmadeBody], seconds: float = 1.0) -> SettleReport:
    write_scene(folder, bodies)
    return settle_report(folder, seconds)


def test_a_kitchen_settles_and_its_fridge_opens(tmp_path: Path) -> None:
    report = report_of(tmp_path, kitchen(door_value=0.0), seconds=3.0)
    assert report.settled
    assert [body.name for body in report.bodies] == ["bottle_7", "cup_5"]
    assert [(joint.joint, joint.free_share) for joint in report.joints] == [("fridge_2__hinge", 1.0)]
    assert report.max_penetration_mm < 0.1 and not report.collisions


def test_a_scene_in_which_nothing_can_move_has_not_settled(tmp_path: Path) -> None:
    report = report_of(tmp_path, [floor(), table(0.0, 0.0)])
    assert report.verdict == "nothing_movable" and not report.settled
    assert run(["urdf", "settle", str(tmp_path)]) == 4
    assert report_of(tmp_path / "door", [floor(), fridge(0.0, 0.0)]).verdict == "ok"  # a joint moves


def test_what_lies_in_something_has_not_settled(tmp_path: Path) -> None:
    blocks = [block("block_4", (3.0, 0.0, 0.5), (1, 1, 1)), block("block_5", (3.98, 0.0, 0.5), (1, 1, 1))]
    report = report_of(tmp_path, [*kitchen(door_value=0.0), *blocks])
    assert report.verdict == "penetrating" and not report.unsettled and not report.settled
    assert "20 mm in block" in report.reason


def test_what_hangs_in_the_air_moves_by_its_height(tmp_path: Path) -> None:
    report = report_of(tmp_path, [floor(), bottle(0.0, 0.0, 0.03, "floor_1")])
    assert not report.settled
    assert report.bodies[0].moved == pytest.approx(0.03, abs=0.002)
    assert not report.bodies[0].fell_through


def test_what_stands_over_the_edge_turns(tmp_path: Path) -> None:
    """4 cm of 6 cm lie over the edge of the table at x = 0.6."""
    report = report_of(tmp_path, [floor(), table(0.0, 0.0), bottle(0.61, 0.0, 0.75, "table_3", "supports")])
    assert report.bodies[0].turned > 0.5
    assert not report.bodies[0].stays


def test_without_a_floor_below_it_a_body_falls_through(tmp_path: Path) -> None:
    report = report_of(tmp_path, [floor(), bottle(4.0, 0.0, 0.1, "floor_1")])
    assert report.bodies[0].fell_through
    report = report_of(tmp_path, [block("block_1", (0, 0, 0), (1, 1, 1)), bottle(4.0, 0.0, 0.1, SCENE_NODE)])
    assert report.bodies[0].fell_through


@pytest.mark.parametrize("gap", [0.012, 0.1, 0.3])
def test_a_drawer_meets_a_wall_after_the_gap(tmp_path: Path, gap: float) -> None:
    """It has met the wall once it is 5 mm in it; steps are a hundredth of 0.4 m."""
    wall = block("block_4", (0.0, -0.3 - gap - 0.05, 0.7), (2.0, 0.1, 1.0))
    joint = report_of(tmp_path, [floor(), drawer(), wall], 0.0).joints[0]
    assert joint.free_share * 0.4 == pytest.approx(gap + 0.005, abs=0.0041)
    assert (joint.hit_link, joint.free_at_start) == ("block_4", gap > 0.04)
    assert 0.005 < joint.hit_depth < 0.0095
    assert joint.hit_at == pytest.approx(joint.free_share * 0.4 + 0.004)


def test_a_door_meets_a_wall_at_the_angle_of_the_triangle(tmp_path: Path) -> None:
    """The far corner of a leaf 0.6 m wide, whose outer face is 2.5 cm in front of its hinge, comes
    0.6 sin(angle) + 0.025 cos(angle) forward of the hinge."""
    leaf = fridge(0.0, 0.0)
    leaf.door = leaf.door[:1]
    wall = block("block_4", (0.0, -0.285 - 0.325 - 0.05, 0.7), (3.0, 0.1, 1.0))
    joint = report_of(tmp_path, [floor(), leaf, wall], 0.0).joints[0]
    angles = np.linspace(0, 1.5, 100001)
    expected = angles[np.argmax(0.6 * np.sin(angles) + 0.025 * np.cos(angles) > 0.325 + 0.005)]
    assert joint.hit_at == pytest.approx(expected, abs=0.022)
    assert joint.hit_at > expected - 1e-6


def test_a_drawer_that_is_closed_into_something_is_not_free(tmp_path: Path) -> None:
    inside = block("block_4", (0.0, -0.3, 0.7), (2.0, 0.1, 0.05))
    report = report_of(tmp_path, [floor(), drawer(), inside], 0.0)
    assert report.joints[0].free_share == 0.0
    assert report.blocked and not report.settled
    assert report.collisions[0].depth == pytest.approx(0.05, abs=1e-4)


def test_contents_and_what_stands_on_them_ride_along(tmp_path: Path) -> None:
    """They lie in the way of the drawer, but in the chest."""
    lying = bottle(0.0, -0.4, 0.65, "chest_2", "contains", "bottle_3")
    on_top = bottle(0.1, -0.4, 0.65, "bottle_3", "supports", "bottle_4")
    assert report_of(tmp_path, [floor(), drawer(), lying, on_top], 0.0).joints[0].free_share == 1.0
    beside = bottle(0.0, -0.4, 0.65, "floor_1", "supports", "bottle_3")
    assert report_of(tmp_path, [floor(), drawer(), beside], 0.0).joints[0].hit_link == "bottle_3"


def test_the_sweep_leaves_the_joints_where_they_were(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor(), fridge(0.0, 0.0, door_value=1.1)])
    first, second = settle_report(tmp_path, 0.5), settle_report(tmp_path, 0.5)
    assert first == second


def test_pairs_are_as_deep_as_their_boxes_overlap(tmp_path: Path) -> None:
    bodies = [floor(), block("block_1", (0, 0, 0.5), (0.4, 0.4, 1.0)), block("block_2", (0.37, 0, 0.5), (0.4, 0.4, 1))]
    report = report_of(tmp_path, bodies, 0.0)
    assert [(pair.first, pair.second) for pair in report.overlaps] == [("block_1", "block_2")]
    assert report.max_penetration_mm == pytest.approx(30.0, abs=0.1)


def test_the_command_prints_a_line_a_finding(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_scene(tmp_path, [floor(), bottle(0.0, 0.0, 0.03, "floor_1")])
    assert run(["urdf", "settle", str(tmp_path), "--seconds", "1"]) == 4
    lines = capfd.readouterr().out.splitlines()
    assert len(lines) == 1 and "bottle_7: does not stay: moves" in lines[0]
    assert run(["urdf", "settle", str(tmp_path), "--seconds", "1", "--moved", "0.05", "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["sound"] and found["bodies"][0]["stays"] and found["bodies"][0]["moved"] > 0.02


def test_a_folder_without_scene_is_bad_input(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["urdf", "settle", str(tmp_path)]) == 3
    assert "scene.json: file is missing" in capfd.readouterr().err

"""What looks tell: the truth, the truth through errors, and shapes fitted to pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.stages.kit.acting.erring_robot import ErringRobot
from scenewright.stages.kit.acting.errors import Luck, SegmenterErrors, SegmenterRates, segmenter_rates
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.motion.segments import Segment
from scenewright.stages.kit.simulation.robot import Configuration
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.world import load_scene, read_scene_bodies
from scenewright.stages.plan.camera_eyes import CameraEyes
from scenewright.stages.plan.eyes import Room
from scenewright.stages.plan.pictures import RoomPictures
from scenewright.stages.plan.pose_fit import fit_upright
from scenewright.stages.plan.room_segmenter import room_segmenter
from scenewright.stages.plan.world_model import WorldModel

NEVER = segmenter_rates("thesis").times(0.0)
ALWAYS = replace(NEVER, missed=1.0)


def box_surface(random: np.random.Generator, count: int, sides: int = 5) -> np.ndarray:
    """Points on the sides (+x, -y, top, -x, +y) of a box of 12 x 6 x 20 cm around the origin."""
    points = random.uniform(-1, 1, (count, 3)) * (0.06, 0.03, 0.1)
    side = np.arange(count) % sides
    for k, (axis, value) in enumerate(((0, 0.06), (1, -0.03), (2, 0.1), (0, -0.06), (1, 0.03))):
        points[side == k, axis] = value
    return points


def test_a_shape_is_fitted_to_the_side_that_was_seen() -> None:
    """Three of five sides with 2 mm of noise, 4 cm and 0.15 rad away, with strays."""
    random = np.random.default_rng(0)
    truth = transform_from_yaw(0.15, np.array([0.03, -0.02, 0.015]))
    seen = apply(truth, box_surface(random, 900, sides=3)) + random.normal(0, 0.002, (900, 3))
    seen[:40] += (0.0, 0.0, -0.12)
    found = fit_upright(seen, box_surface(random, 3000))
    assert np.linalg.norm((found - truth)[:3, 3]) < 0.004
    assert abs(np.arctan2(found[1, 0], found[0, 0]) - 0.15) < 0.03


@pytest.fixture
def sight(scene: Path, kitchen_model: WorldModel) -> Iterator[SimpleNamespace]:
    """The kitchen as believed, and one in which the robot stands before its table with a known error."""
    before = kitchen_model.snapshot()
    bodies = read_scene_bodies(scene)
    room = Room(
        {name: record for name, (record, _) in bodies.items()},
        {name: text for name, (_, text) in bodies.items()},
        {name: () for name in bodies},
    )
    with load_scene(scene) as world:
        robot = load_robot("panda")
        start = Configuration(np.array([-1.3, -0.2, -np.pi / 2]), robot.carry, robot.opening)
        erring = ErringRobot(world, robot, start, 1.0, np.random.default_rng(0))
        erring.error = np.array([0.01, -0.02, 0.0])
        yield SimpleNamespace(model=kitchen_model, room=room, world=world, robot=erring)
    kitchen_model.restore(before)


def eyes_of(sight: SimpleNamespace, rates: SegmenterRates = NEVER) -> CameraEyes:
    """Camera eyes with a simulated segmenter."""
    pictures = RoomPictures(sight.world, sight.room.records, sight.room.texts, load_robot("panda"))
    segmenter = room_segmenter(sight.room, sight.world, SegmenterErrors(rates, Luck(0), ("bottle", "cup")))
    return CameraEyes(sight.model, pictures, sight.robot, segmenter, np.random.default_rng(0), 0.5)


def test_camera_eyes_fit_what_is_carried_and_know_no_truth(sight: SimpleNamespace) -> None:
    """The bottle stands on the table, not where it is believed; what is missed or fixed is not seen."""
    sight.model.world.set_pose("bottle_7", transform_from_yaw(0.0, np.array([-1.25, -1.05, 0.75])))
    sight.world.set_pose("bottle_7", transform_from_yaw(0.4, np.array([-1.3, -1.1, 0.75])))

    seen = eyes_of(sight).seen("bottle_7", "")
    assert seen is not None
    pose = inverse(sight.robot.map_from_true()) @ np.array(seen[0].world_from_body)
    assert pose[:3, 3] == pytest.approx([-1.3, -1.1, 0.75], abs=0.015)
    assert eyes_of(sight, ALWAYS).seen("bottle_7", "") is None
    table = eyes_of(sight).seen("table_3", "")
    assert table is not None
    pose = inverse(sight.robot.map_from_true()) @ np.array(table[0].world_from_body)
    assert pose[2, 3] == pytest.approx(sight.world.pose("table_3")[2, 3], abs=0.01)


def test_camera_eyes_do_not_take_a_thing_for_another_of_its_class(sight: SimpleNamespace) -> None:
    """A bottle that is hidden stays where it is believed, however near another one is seen."""
    believed = transform_from_yaw(0.0, np.array([-1.1, -1.1, 0.75]))
    sight.model.see("bottle_8", sight.model.records["bottle_7"], sight.model.text("bottle_7"), ())
    try:
        sight.model.world.set_pose("bottle_8", believed)
        sight.model.world.set_pose("bottle_7", transform_from_yaw(0.0, np.array([-1.3, -1.1, 0.75])))
        sight.world.set_pose("bottle_7", transform_from_yaw(0.0, np.array([-1.3, -1.1, 0.75])))
        eyes = eyes_of(sight)
        assert eyes.seen("bottle_8", "") is None
        assert eyes.seen("bottle_7", "") is not None
    finally:
        sight.model.forget("bottle_8")


def test_camera_eyes_find_what_fell_to_the_floor(sight: SimpleNamespace) -> None:
    sight.model.world.set_pose("bottle_7", transform_from_yaw(0.0, np.array([-1.25, -1.05, 0.75])))
    lying = transform_from_yaw(0.3, np.array([-0.75, -0.3, 0.04]))
    lying[:3, :3] = lying[:3, :3] @ np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])
    sight.world.set_pose("bottle_7", lying)
    eyes = eyes_of(sight)
    seen = eyes.seen("bottle_7", "")
    assert seen is not None
    pose = inverse(sight.robot.map_from_true()) @ np.array(seen[0].world_from_body)
    assert abs(pose[2, 2]) < 0.2
    assert pose[:2, 3] == pytest.approx(lying[:2, 3], abs=0.25)  # foot and top may be taken for one another
    assert pose[2, 3] == pytest.approx(lying[2, 3], abs=0.02)


def test_camera_eyes_find_furniture_nearer_than_it_was_believed(sight: SimpleNamespace) -> None:
    """The fridge stands 4 cm nearer than in the map: its front says so, and its door is as far open as it is."""
    robot, true = load_robot("panda"), sight.world.pose("fridge_2")
    sight.robot.put(Configuration(np.array([0.0, 1.5, 0.0]), robot.carry, robot.opening))
    believed = true.copy()
    believed[0, 3] += 0.04
    sight.model.world.set_pose("fridge_2", believed)
    seen = eyes_of(sight).seen("fridge_2", "")
    assert seen is not None
    pose = inverse(sight.robot.map_from_true()) @ np.array(seen[0].world_from_body)
    assert pose[0, 3] == pytest.approx(true[0, 3], abs=0.012)
    assert pose[:3, 3] == pytest.approx(true[:3, 3], abs=0.04)  # along its front the points say little
    assert seen[0].joint_values["fridge_2__hinge"] == pytest.approx(
        sight.world.joint_value("fridge_2", "fridge_2__hinge"), abs=0.1
    )


def test_a_robot_that_errs_stops_beside_where_it_was_sent_and_goes_back_as_believed(sight: SimpleNamespace) -> None:
    arm = load_robot("panda").carry
    rows = np.array([[-1.29, -0.22, -np.pi / 2, *arm], [-1.29, 0.3, -np.pi / 2, *arm]])
    sight.robot.follow(Segment(rows, 0.0), None)
    off = rows[-1, :3] - sight.robot.robot.configuration().base
    assert 0.001 < np.abs(off[:2]).max() < 0.04
    assert sight.robot.way_back()[-1, :3] == pytest.approx(rows[-1, :3], abs=1e-9)
    assert sight.robot.map_from_true()[:2, 3] == pytest.approx(off[:2], abs=0.02)

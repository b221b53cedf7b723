"""Trays: where the palm passes what stands on them, what turns them in the fingers, and low rims."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.acting.hand.rim_grasps import DEPTH, FOOT_ROOM, LEAST_DEPTH, askew, rim_grasps
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.kit.simulation.shapes import surface_points
from scenewright.stages.plan.affordances import has_rim
from scenewright.stages.plan.tray_loading import (
    GRAVITY,
    PALM_ROOM,
    free_lanes,
    holding_moments,
    lifts_left,
    lifts_left_beside,
    load_moments,
    twisting_moments,
)
from scenewright.stages.plan.world_model import WorldModel

from tests.unit.simulation.handmade_scene import HandmadeBody, floor, table, write_scene

PALM = (0.2, 0.06)
PANDA = load_robot("panda")


def from_above(x: float, y: float, heading: float, z: float = 0.8) -> np.ndarray:
    """A tool pose straight down whose fingers close along a heading [rad]."""
    closing = np.array([np.cos(heading), np.sin(heading), 0.0])
    approach = np.array([0.0, 0.0, -1.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(closing, approach), closing, approach])
    pose[:3, 3] = [x, y, z]
    return pose


def room_beside(pose: np.ndarray, foot: np.ndarray) -> float:
    """Distance [m] from a round foot's rim to the palm's rectangle, by many points of the rectangle's area."""
    y, x = np.meshgrid(np.linspace(-0.5, 0.5, 201) * PALM[0], np.linspace(-0.5, 0.5, 61) * PALM[1])
    points = apply(pose, np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))[:, :2]
    return float(np.linalg.norm(points - foot[:2], axis=1).min() - foot[2])


@pytest.mark.parametrize(
    ("x", "y", "needed"),
    [
        (0.0, 0.0, None),  # over it
        (0.10 + 0.03 + PALM_ROOM, 0.0, 0.001),  # beyond the end along which the fingers close
        (0.0, 0.03 + 0.03 + PALM_ROOM, 0.001),  # beside the palm
        (0.10 + (0.03 + PALM_ROOM) * 0.6, 0.03 + (0.03 + PALM_ROOM) * 0.8, 0.001),  # off its corner: 3-4-5
    ],
)
def test_the_palm_over_a_disc(x: float, y: float, needed: float | None) -> None:
    pose = from_above(0.0, 0.0, 0.0)[None]
    assert not free_lanes(pose, np.array([[x * 0.999, y * 0.999, 0.03]]), PALM)[0]
    if needed is not None:
        outward = np.array([x, y]) / np.hypot(x, y)
        assert free_lanes(pose, np.array([[x + needed * outward[0], y + needed * outward[1], 0.03]]), PALM)[0]


def test_every_foot_counts_and_every_pose_has_its_own_answer() -> None:
    poses = np.array([from_above(0.0, 0.0, 0.0), from_above(0.0, 0.0, np.pi / 2)])
    aside, ahead = [0.0, 0.08, 0.02], [0.15, 0.0, 0.02]
    assert free_lanes(poses, np.array([aside]), PALM).tolist() == [True, False]
    assert free_lanes(poses, np.array([ahead]), PALM).tolist() == [True, True]
    assert free_lanes(poses, np.array([aside, ahead]), PALM).tolist() == [True, False]


metres = st.floats(-0.3, 0.3)


@settings(max_examples=40, deadline=None)
@given(metres, metres, metres, metres, st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.floats(0.005, 0.1))
def test_turning_everything_about_the_vertical_changes_nothing(
    x: float, y: float, foot_x: float, foot_y: float, heading: float, turn: float, radius: float
) -> None:
    pose, foot = from_above(x, y, heading), np.array([foot_x, foot_y, radius])
    beside = room_beside(pose, foot) - PALM_ROOM
    assume(abs(beside) > 0.001)  # the points of the second implementation are up to 1 mm apart
    rotation = transform_from_yaw(turn, np.zeros(3))
    turned_foot = np.array([*(rotation[:2, :2] @ foot[:2]), radius])
    for tool, disc in ((pose, foot), (rotation @ pose, turned_foot)):
        assert bool(free_lanes(tool[None], disc[None], PALM)[0]) == (beside > 0)
    places, masses = np.array([[foot_x, foot_y], [0.1, -0.2], [x, 0.0]]), np.array([0.3, 0.5, radius])
    before = holding_moments(pose[None], places, masses)
    after = holding_moments((rotation @ pose)[None], places @ rotation[:2, :2].T, masses)
    np.testing.assert_allclose(before, after, atol=1e-12)


def test_moments_of_a_lever() -> None:
    poses = np.array([from_above(0.0, 0.0, 0.0), from_above(0.3, 0.0, 1.0), from_above(0.15, 0.2, 2.0)])
    single = holding_moments(poses, np.array([[0.3, 0.4]]), np.array([2.0]))
    assert single == pytest.approx([GRAVITY * 2.0 * 0.5, GRAVITY * 2.0 * 0.4, GRAVITY * 2.0 * 0.25])
    # a pair about its middle turns nothing; a third of the mass at one end weighs at that end
    pair = holding_moments(poses, np.array([[0.1, 0.0], [0.2, 0.4]]), np.array([1.0, 1.0]))
    assert pair[2] == pytest.approx(0.0, abs=1e-12)
    assert pair[0] == pytest.approx(GRAVITY * 2.0 * 0.25)
    torques = [
        sum(
            np.cross(np.array([x, y, 0.0]) - pose[:3, 3] * [1, 1, 0], [0, 0, -GRAVITY * m])
            for (x, y), m in (((0.1, 0.3), 0.2), ((-0.2, 0.1), 1.1))
        )
        for pose in poses
    ]
    found = holding_moments(poses, np.array([[0.1, 0.3], [-0.2, 0.1]]), np.array([0.2, 1.1]))
    assert found == pytest.approx(np.linalg.norm(torques, axis=1))


def test_what_twists_in_the_fingers_is_the_lever_across_their_way() -> None:
    poses = np.array([from_above(0.0, 0.0, 0.0), from_above(0.0, 0.0, np.pi / 2), from_above(0.0, 0.0, np.pi / 4)])
    across = poses[:, :2, 0] @ np.array([0.3, 0.4])
    twists = twisting_moments(poses, np.array([[0.3, 0.4]]), np.array([2.0]))
    assert twists == pytest.approx(GRAVITY * 2.0 * np.abs(across))
    assert np.all(twists <= holding_moments(poses, np.array([[0.3, 0.4]]), np.array([2.0])))


# --- a tray in a scene ----------------------------------------------------------------------------------------


def tray(height: float = 0.05, mass: float = 0.3) -> HandmadeBody:
    """A tray 36 cm x 28 cm with walls 6 mm thick, in the middle of the table; its origin is on its foot."""
    boxes = [((0.0, 0.0, 0.003), (0.36, 0.28, 0.006))]
    boxes += [((side * 0.177, 0.0, height / 2), (0.006, 0.28, height)) for side in (-1, 1)]
    boxes += [((0.0, side * 0.137, height / 2), (0.36, 0.006, height)) for side in (-1, 1)]
    pose = transform_from_yaw(0.4, np.array([0.0, 0.0, 0.75]))
    return HandmadeBody("tray_6", "tray", pose, boxes, "table_3", movable=True, mass=mass)


def can(name: str, x: float, y: float, parent: str, mass: float = 0.2) -> HandmadeBody:
    pose = transform_from_yaw(0.0, np.array([x, y, 0.75]))
    return HandmadeBody(name, "can", pose, [((0, 0, 0.05), (0.05, 0.05, 0.1))], parent, movable=True, mass=mass)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("tray")
    write_scene(
        root, [floor(), table(0.0, 0.0), tray(), can("can_7", 0.5, 0.2, "table_3"), can("can_8", 0.5, -0.2, "table_3")]
    )
    return root


def on_tray(model: WorldModel, x: float, y: float) -> np.ndarray:
    return model.pose("tray_6") @ transform_from_yaw(0.0, np.array([x, y, 0.006]))


def test_lifts_left_are_the_grasps_that_pass_and_bear(model: WorldModel) -> None:
    """Against the two conditions by another way: points of the palm, and torques about the tool point one by one."""
    model.world.set_pose("can_8", on_tray(model, -0.1, 0.05))
    model.put_on("can_8", "tray_6")
    places = np.array([on_tray(model, x, y) for x, y in ((0.0, 0.0), (0.14, 0.0), (0.05, -0.1), (0.14, 0.1))])
    grasps = rim_grasps(model.points("tray_6"), model.pose("tray_6"), np.random.default_rng(0))
    lifts = lifts_left(model, "tray_6", "can_7", places)
    expected = []
    for place in places:
        feet = [(model.pose("can_8"), "can_8", 0.2), (place, "can_7", 0.2)]
        weights = [(model.pose("tray_6"), 0.3), *((pose, mass) for pose, _, mass in feet)]
        count = 0
        for grasp in grasps:
            tool = model.pose("tray_6") @ grasp.body_from_tool
            half = np.array(PANDA.palm) / 2
            free = True
            for pose, name, _ in feet:
                local = (tool[:3, :3].T @ (pose[:3, 3] - tool[:3, 3]))[[1, 0]]
                nearest = np.clip(local, -half, half)
                free &= bool(np.linalg.norm(local - nearest) > model.footprint(name)[0] + PALM_ROOM)
            torque = sum(np.cross((pose - tool)[:3, 3] * [1, 1, 0], [0, 0, -GRAVITY * mass]) for pose, mass in weights)
            count += free and float(np.linalg.norm(torque)) < PANDA.holding_moment
        expected.append(count)
    assert lifts.tolist() == expected
    assert len(set(lifts.tolist())) > 1 and lifts.max() > 0


def test_a_heavy_thing_leaves_the_lifts_near_it(tmp_path: Path) -> None:
    """By its edge a tray with 0.6 kg on the other side turns in the fingers, with the same beside them it does not."""
    write_scene(tmp_path, [floor(), table(0.0, 0.0), tray(), can("can_7", 0.5, 0.2, "table_3", mass=0.6)])
    model = WorldModel(tmp_path, ContactGraphFile.read(tmp_path / "graph.json"), PANDA, 0.004)
    try:
        model.world.set_pose("can_7", on_tray(model, 0.12, 0.0))
        model.put_on("can_7", "tray_6")
        tool = np.array([model.pose("tray_6") @ from_above(x, 0.0, 0.0, 0.03) for x in (0.177, -0.177)])
        near, far = load_moments(model, "tray_6", tool)
        assert near == pytest.approx(GRAVITY * (0.3 * 0.177 + 0.6 * 0.057), abs=1e-6)
        assert far == pytest.approx(GRAVITY * (0.3 * 0.177 + 0.6 * 0.297), abs=1e-6)
        assert near < PANDA.holding_moment < far
        # the can itself does not count twice when it is asked where it could stand
        again = lifts_left(model, "tray_6", "can_7", on_tray(model, 0.12, 0.0)[None])
        model.put_on("can_7", "table_3")
        assert again.tolist() == lifts_left(model, "tray_6", "can_7", on_tray(model, 0.12, 0.0)[None]).tolist()
    finally:
        model.close()


def test_without_a_rim_nothing_is_left(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor(), table(0.0, 0.0), tray(0.02), can("can_7", 0.5, 0.2, "table_3")])
    model = WorldModel(tmp_path, ContactGraphFile.read(tmp_path / "graph.json"), PANDA, 0.004)
    try:
        places = np.array([on_tray(model, 0.0, 0.0), on_tray(model, 0.1, 0.0)])
        assert lifts_left(model, "tray_6", "can_7", places).tolist() == [0, 0]
        assert lifts_left(model, "tray_6", "can_7", places, uncertainty=0.02).max() > 0
        assert not has_rim(model, "tray_6", 0.0) and has_rim(model, "tray_6", 0.02)
    finally:
        model.close()


# --- rims that are higher than they look ----------------------------------------------------------------------


def tray_points(height: float) -> np.ndarray:
    meshes = []
    for center, size in tray(height).boxes:
        box = trimesh.creation.box(extents=size)
        box.apply_translation(center)
        meshes.append(box)
    return surface_points(meshes, 6000, np.random.default_rng(0))[0]


def test_a_rim_that_is_too_low_may_be_higher_than_it_looks() -> None:
    """20 mm high it has no room for the finger tips; that it may be 10 mm higher gives it some."""
    pose = transform_from_yaw(0.7, np.array([0.3, -0.2, 0.75]))
    points = tray_points(0.02)
    assert rim_grasps(points, pose, np.random.default_rng(0)) == []
    assert rim_grasps(points, pose, np.random.default_rng(0), uncertainty=0.003) == []
    found = rim_grasps(points, pose, np.random.default_rng(0), uncertainty=0.01)
    assert found
    for grasp in found:
        assert (pose @ grasp.body_from_tool)[2, 3] == pytest.approx(0.75 + FOOT_ROOM, abs=1e-3)
        assert grasp.body_from_tool[2, 2] == pytest.approx(-1.0)


@pytest.mark.parametrize("height", [0.02, 0.026, 0.033, 0.05])
@pytest.mark.parametrize("uncertainty", [0.0, 0.006, 0.012, 0.04])
def test_the_tool_point_stays_over_the_foot_and_at_the_rim(height: float, uncertainty: float) -> None:
    """Never nearer to the table than FOOT_ROOM, never deeper than DEPTH below the rim, however uncertain that is."""
    pose = transform_from_yaw(0.7, np.array([0.3, -0.2, 0.75]))
    found = rim_grasps(tray_points(height), pose, np.random.default_rng(0), uncertainty=uncertainty)
    assert bool(found) == (height + uncertainty >= FOOT_ROOM + LEAST_DEPTH)
    for grasp in found:
        z = (pose @ grasp.body_from_tool)[2, 3] - 0.75
        assert z >= FOOT_ROOM - 1e-3
        assert z == pytest.approx(max(FOOT_ROOM, height - DEPTH), abs=2e-3)


def test_a_high_rim_is_not_taken_to_be_higher() -> None:
    pose = transform_from_yaw(0.0, np.zeros(3))
    points = tray_points(0.05)
    sure, unsure = (rim_grasps(points, pose, np.random.default_rng(0), uncertainty=u) for u in (0.0, 0.02))
    assert len(sure) == len(unsure) > 0
    for first, second in zip(sure, unsure, strict=True):
        np.testing.assert_array_equal(first.body_from_tool, second.body_from_tool)


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_fingers_close_square_to_straight_walls(yaw: float) -> None:
    """A hand that closes askew on a wall turns the tray under its load until the wall fits."""
    pose = transform_from_yaw(yaw, np.array([0.3, -0.2, 0.75]))
    found = rim_grasps(tray_points(0.05), pose, np.random.default_rng(0))
    assert found
    for grasp in found:
        closing = np.abs(grasp.body_from_tool[:2, 1])
        assert min(closing) < 0.12


def test_a_round_rim_is_square_everywhere() -> None:
    angles = np.linspace(-np.pi, np.pi, 2000)
    for heading in (0.0, 0.5, 2.0):
        ring = 0.085 * np.column_stack([np.cos(angles), np.sin(angles)])
        outward = np.array([np.cos(heading), np.sin(heading)])
        assert askew(ring @ [-outward[1], outward[0]], ring @ outward) < 0.02
    wall = np.column_stack([np.linspace(-0.1, 0.1, 400), np.full(400, 0.12)])
    turned = wall @ np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    assert askew(turned[:, 0], turned[:, 1]) == pytest.approx(0.3, abs=0.02)


def test_a_place_in_the_middle_of_a_tray_leaves_no_room_for_what_comes_next(model: WorldModel) -> None:
    """The other can has one spot, 6 cm beside the middle: beside the item at one end it can stand there, not beside
    one in the middle. And what both leave is what is counted with the other put there first."""
    places = np.array([on_tray(model, x, 0.0) for x in (0.0, -0.14)])
    spots = on_tray(model, 0.055, 0.0)[None]
    left = lifts_left_beside(model, "tray_6", "can_7", places, "can_8", spots)
    model.world.set_pose("can_8", spots[0])
    model.put_on("can_8", "tray_6")
    assert left[0] == 0
    assert left[1] == lifts_left(model, "tray_6", "can_7", places)[1] > 0

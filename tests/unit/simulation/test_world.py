"""Loading an interactive scene into physics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene, read_scene_bodies

from tests.unit.simulation.handmade_scene import bottle, floor, fridge, kitchen, write_scene


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    write_scene(tmp_path, kitchen(door_value=1.1))
    return tmp_path


def test_joint_values_and_poses_are_those_of_scene_json(scene: Path) -> None:
    with load_scene(scene) as world:
        assert world.joint_value("fridge_2", "fridge_2__hinge") == pytest.approx(1.1)
        for name, (record, _) in read_scene_bodies(scene).items():
            np.testing.assert_allclose(world.pose(name), np.array(record.world_from_body), atol=1e-6)


def test_split_bodies_stand_where_the_whole_static_tree_puts_them(scene: Path) -> None:
    with load_scene(scene) as world, PhysicsWorld() as whole:
        tree = engine.loadURDF(str(scene / "static.urdf"), useFixedBase=True, physicsClientId=whole.client)
        links, joints = whole._names(tree)
        engine.resetJointState(tree, joints["fridge_2__hinge"], 1.1, physicsClientId=whole.client)
        for name, link in (("fridge_2", "fridge_2__door"), ("table_3", "table_3"), ("fridge_2", "fridge_2")):
            state = engine.getLinkState(tree, links[link], computeForwardKinematics=1, physicsClientId=whole.client)
            np.testing.assert_allclose(world.link_pose(name, link)[:3, 3], state[4], atol=1e-6)


def test_a_door_stays_where_it_was_left(scene: Path) -> None:
    with load_scene(scene) as world:
        world.settle(1.0)
        assert world.joint_value("fridge_2", "fridge_2__hinge") == pytest.approx(1.1, abs=0.01)


def test_an_unsupported_body_falls_and_a_supported_one_stays(tmp_path: Path) -> None:
    write_scene(
        tmp_path,
        [floor(), bottle(0.0, 0.0, 1.0, "floor_1", name="bottle_1"), bottle(1.0, 0.0, 0.0, "floor_1", name="bottle_2")],
    )
    with load_scene(tmp_path) as world:
        moved = world.settle(1.5)
        assert moved["bottle_1"] > 0.9
        assert world.pose("bottle_1")[2, 3] < 0.2
        assert moved["bottle_2"] < 0.002


def test_a_sleeping_body_wakes_when_its_support_is_taken_away(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor(), fridge(0.0, 0.0), bottle(0.0, 0.0, 1.4, "fridge_2")])
    with load_scene(tmp_path) as world:
        world.settle(3.0)
        assert world.pose("bottle_7")[2, 3] == pytest.approx(1.4, abs=0.01)
        world.remove_body("fridge_2")
        world.wake()
        world.step(240)
        assert world.pose("bottle_7")[2, 3] < 0.5


def test_two_worlds_go_the_same_way(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor(), bottle(0.0, 0.0, 0.5, "floor_1", name="bottle_1")])
    ends = []
    for _ in range(2):
        with load_scene(tmp_path) as world:
            world.step(300)
            ends.append(world.pose("bottle_1"))
    np.testing.assert_array_equal(ends[0], ends[1])


def test_poses_refer_to_the_link_frame_not_to_the_centre_of_mass(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor(), bottle(0.3, -0.2, 0.0, "floor_1", name="bottle_1")])
    with load_scene(tmp_path) as world:
        low, high = world.bounds("bottle_1")
        assert low[2] == pytest.approx(0.0, abs=0.01)
        assert high[2] == pytest.approx(0.2, abs=0.01)


def test_a_missing_file_or_link_is_named(scene: Path) -> None:
    bottle = (scene / "bodies" / "bottle_7.urdf").rename(scene / "bottle_7.urdf")
    with pytest.raises(BadInput, match=r"bottle_7\.urdf: file is missing"):
        load_scene(scene)
    bottle.rename(scene / "bodies" / "bottle_7.urdf")
    text = (scene / "static.urdf").read_text().replace("table_3", "table_4")
    (scene / "static.urdf").write_text(text)
    with pytest.raises(BadInput, match="table_3"):
        load_scene(scene)


def test_a_broken_urdf_is_refused(scene: Path) -> None:
    (scene / "static.urdf").write_text("<robot><link name=")
    with pytest.raises(BadInput, match="no well-formed XML"):
        load_scene(scene)


@pytest.mark.parametrize(("slope", "slides"), [(8.0, False), (30.0, True)])
def test_anchored_friction_is_still_friction(tmp_path: Path, slope: float, slides: bool) -> None:
    write_scene(tmp_path, [floor(), bottle(0.0, 0.0, 0.0, "floor_1", name="bottle_1")])
    with load_scene(tmp_path) as world:
        world.anchor_friction()
        pull = np.radians(slope)
        gravity = 9.81 * np.array([np.sin(pull), 0.0, -np.cos(pull)])
        engine.setGravity(*gravity, physicsClientId=world.client)
        moved = world.settle(1.0)["bottle_1"]
    assert moved > 0.1 if slides else moved < 1e-3


def test_what_is_loosened_is_as_if_it_had_never_been_anchored(tmp_path: Path) -> None:
    write_scene(tmp_path, [floor(), bottle(0.0, 0.0, 0.0, "floor_1", name="bottle_1")])

    def pushed(anchored: bool, loosened: bool) -> float:
        with load_scene(tmp_path) as world:
            if anchored:
                world.anchor_friction()
            world.settle(0.2)  # the engine remembers what touches meanwhile
            if loosened:
                body = world.bodies["bottle_1"].body_id
                assert world.contacts(body)
                world.loosen("bottle_1")
                assert bool(world.contacts(body)) != anchored  # forgotten, and found anew by the next step
            engine.setGravity(1.4, 0.0, -9.7, physicsClientId=world.client)
            return world.settle(1.0)["bottle_1"]

    creeping, loose, anchored = pushed(False, False), pushed(True, True), pushed(True, False)
    assert loose == pytest.approx(creeping, rel=0.05) and anchored < 0.5 * creeping
    assert pushed(False, True) == creeping  # what is not anchored is left alone

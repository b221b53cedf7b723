"""A drawer behind a door: joints that hang on moving parts, through model folder, URDF, Bullet and MuJoCo."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Box, Joint
from scenewright.stages.kit.formats.cad_models import part_transforms, read_model
from scenewright.stages.kit.formats.model_writer import PartGeometry, write_model_folder
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.geometry.solids import box, mass_properties
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.joint_sweep import sweep_joints

from tests.unit.urdf.small_room import graph_of

VALUES = {"hinge": 0.7, "slide": 0.2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cupboard 0.6 m wide; its door turns about z at x = -0.3, a tray on the door slides along x."""
    joints = (
        Joint(
            name="slide",
            type="prismatic",
            part="tray",
            parent="door",
            origin=(-0.1, -0.35, 0.5),
            axis=(1, 0, 0),
            lower=0.0,
            upper=0.3,
        ),
        Joint(
            name="hinge", type="revolute", part="door", origin=(-0.3, -0.25, 0.0), axis=(0, 0, -1), lower=0.0, upper=1.5
        ),
    )
    model = CadModel(
        id="cupboard",
        class_name="cabinet",
        articulated=True,
        mass=100.0,
        states=(),
        joints=joints,
        movable=False,
        parts=("body", "tray", "door"),
    )
    blocks = {
        "body": box((-0.3, 0.3), (-0.25, 0.25), (0.0, 1.0)),
        "tray": box((-0.1, 0.1), (-0.05, 0.05), (0.0, 0.05)),
        "door": box((0.0, 0.6), (-0.02, 0.0), (0.0, 1.0)),
    }
    parts = [
        PartGeometry(name, [solid], [(200, 180, 160)], mass_properties([solid], [300.0]))
        for name, solid in blocks.items()
    ]
    root = tmp_path_factory.mktemp("model")
    write_model_folder(root, model, parts)
    return root


def expected_tray(scale: float) -> np.ndarray:
    """Where the tray is by the chain written out: about the hinge, then along the turned x."""
    turn = transform_from_yaw(-VALUES["hinge"], np.zeros(3))
    pose = turn.copy()
    on_door = np.array([-0.1, -0.35, 0.5]) - [-0.3, -0.25, 0.0] + np.array([VALUES["slide"], 0, 0])
    pose[:3, 3] = scale * (np.array([-0.3, -0.25, 0.0]) + turn[:3, :3] @ on_door)
    return pose


def body(folder: Path, scale: float) -> BundleBody:
    model = read_model(folder)
    return BundleBody(
        name="cabinet_1",
        class_name="cabinet",
        parent=None,
        relation="supports",
        world_from_body=np.eye(4),
        movable=False,
        box=Box(center=(0, 0, 0.5), size=(0.6, 0.5, 1.0)),
        model=model,
        model_folder=folder,
        scale=scale,
        joint_values=VALUES,
    )


def test_the_model_moves_what_hangs_on_a_moving_part(folder: Path) -> None:
    poses = part_transforms(read_model(folder), VALUES)
    np.testing.assert_allclose(poses["tray"], expected_tray(1.0), atol=1e-12)


@pytest.mark.parametrize("scale", [1.0, 1.3])
def test_bullet_and_mujoco_put_it_where_the_model_says(folder: Path, tmp_path: Path, scale: float) -> None:
    thing = body(folder, scale)
    scene = write_scene_bundle(tmp_path, [thing], graph_of([thing]))
    tray = next(joint for joint in scene.bodies[0].joints if joint.name == "cabinet_1__slide")
    assert (tray.part, tray.parent) == ("cabinet_1__tray", "cabinet_1__door")
    with load_scene(tmp_path) as world:
        np.testing.assert_allclose(world.link_pose("cabinet_1", "cabinet_1__tray"), expected_tray(scale), atol=1e-6)
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.mjcf.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.body("cabinet_1__tray").xpos, expected_tray(scale)[:3, 3], atol=1e-6)


def test_to_hang_on_the_body_by_name_is_to_hang_on_the_body(folder: Path, tmp_path: Path) -> None:
    thing = body(folder, 1.0)
    assert thing.model is not None
    named = tuple(joint.model_copy(update={"parent": joint.parent or "body"}) for joint in thing.model.joints)
    same = replace(thing, model=thing.model.model_copy(update={"joints": named}))
    first = write_scene_bundle(tmp_path / "first", [thing], graph_of([thing]))
    assert write_scene_bundle(tmp_path / "second", [same], graph_of([same])) == first
    for name in ("scene.urdf", "scene.mjcf.xml"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()


@pytest.mark.parametrize(("parent", "message"), [("lid", "which is no part"), ("tray", "in a circle")])
def test_a_joint_that_hangs_on_nothing_or_itself_is_bad_input(
    folder: Path, tmp_path: Path, parent: str, message: str
) -> None:
    model = read_model(folder)
    joints = (model.joints[0], model.joints[1].model_copy(update={"parent": parent}))
    model.model_copy(update={"joints": joints}).write(tmp_path / "model.json")
    with pytest.raises(BadInput, match=message):
        read_model(tmp_path)


def behind_a_door(root: Path) -> Path:
    """A cupboard with a rack that slides out to the front (-y), and a door right before it that turns about z."""
    joints = (
        Joint(name="rack", type="prismatic", part="rack", origin=(0, 0, 0.4), axis=(0, -1, 0), lower=0.0, upper=0.4),
        Joint(
            name="hinge", type="revolute", part="door", origin=(-0.3, -0.26, 0.0), axis=(0, 0, -1), lower=0.0, upper=1.6
        ),
    )
    model = CadModel(
        id="cupboard",
        class_name="cabinet",
        articulated=True,
        mass=100.0,
        states=(),
        joints=joints,
        movable=False,
        parts=("body", "rack", "door"),
    )
    blocks = {
        "body": box((-0.3, 0.3), (0.22, 0.25), (0.0, 1.0)),
        "rack": box((-0.2, 0.2), (-0.25, 0.2), (0.0, 0.05)),
        "door": box((0.0, 0.6), (-0.02, 0.0), (0.0, 1.0)),
    }
    parts = [
        PartGeometry(name, [solid], [(200, 180, 160)], mass_properties([solid], [300.0]))
        for name, solid in blocks.items()
    ]
    write_model_folder(root, model, parts)
    return root


def test_a_rack_behind_a_closed_door_is_not_blocked_but_one_before_a_wall_is(tmp_path: Path) -> None:
    """The door is opened first, and is closed again afterwards."""
    cupboard = body(behind_a_door(tmp_path / "model"), 1.0)
    cupboard = replace(cupboard, joint_values={})
    write_scene_bundle(tmp_path / "open", [cupboard], graph_of([cupboard]))
    with load_scene(tmp_path / "open") as world:
        ranges = {entry.joint.rsplit("__", 1)[-1]: entry for entry in sweep_joints(world)}
        assert all(entry.free_at_start for entry in ranges.values()), ranges
        assert ranges["rack"].free_share > 0.9
        assert all(world.joint_value("cabinet_1", name) == 0.0 for name in world.bodies["cabinet_1"].joints)
    front = cupboard.world_from_body @ np.array([0.0, -0.45, 0.5, 1.0])
    wall = trimesh.creation.box((2.0, 0.1, 1.0), trimesh.transformations.translation_matrix(front[:3]))
    other = BundleBody(
        name="wall_2",
        class_name="wall",
        parent=None,
        relation="supports",
        world_from_body=np.eye(4),
        movable=False,
        box=Box(center=tuple(front[:3]), size=(2.0, 0.1, 1.0)),
        mesh=wall,
    )
    write_scene_bundle(tmp_path / "shut", [cupboard, other], graph_of([cupboard, other]))
    with load_scene(tmp_path / "shut") as world:
        ranges = {entry.joint.rsplit("__", 1)[-1]: entry for entry in sweep_joints(world)}
        assert ranges["rack"].free_share < 0.6

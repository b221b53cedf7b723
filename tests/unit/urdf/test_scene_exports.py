"""What stands beside scene.urdf: SRDF, GLB, MCAP and MJCF, wherever the folder is moved to."""

from __future__ import annotations

import json
import shutil
import struct
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.stages.kit.formats.foxglove import transform_matrix
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.exporters.glb import linear
from scenewright.stages.urdf.exports import write_exports
from scenewright.stages.urdf.mujoco_settle import mujoco_motions
from scenewright.stages.urdf.settle_report import settle_report

from tests.unit.urdf.small_room import graph_of, room


@pytest.fixture(scope="module")
def made(library: CadLibrary, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small room, its fridge ajar."""
    bodies = room(library)
    root = tmp_path_factory.mktemp("scene")
    write_exports(root, write_scene_bundle(root, bodies, graph_of(bodies)))
    return root


@pytest.fixture
def scene(made: Path, tmp_path: Path) -> Path:
    """The same folder, moved elsewhere after it was written."""
    root = tmp_path / "moved here"
    shutil.copytree(made, root)
    return root


def poses_and_values(scene: Path) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    description = InteractiveSceneFile.read(scene / "scene.json")
    values = {name: value for body in description.bodies for name, value in body.joint_values.items()}
    return link_poses(parse_urdf(scene / "scene.urdf"), values), values


def test_glb_has_a_node_a_link_where_it_stands(scene: Path) -> None:
    loaded = trimesh.load(scene / "scene.glb", force="scene")
    y_up_from_z_up = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    poses, values = poses_and_values(scene)
    assert any(values.values())
    for link, pose in poses.items():
        found, _ = loaded.graph.get("scene" if link == "world" else link)
        np.testing.assert_allclose(found, y_up_from_z_up @ pose, atol=1e-6)
    assert loaded.bounds[1][1] == pytest.approx(2.5)  # the top of the wall


def test_glb_colours_are_linear_and_joints_are_named(scene: Path) -> None:
    data = (scene / "scene.glb").read_bytes()
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size = struct.unpack("<I", data[12:16])[0]
    document = json.loads(data[20 : 20 + size])
    urdf = parse_urdf(scene / "scene.urdf")
    link = urdf.link("cup_5")
    mesh = next(entry for entry in document["meshes"] if entry["name"] == "cup_5")
    for shape, primitive in zip(link.visuals, mesh["primitives"], strict=True):
        factor = document["materials"][primitive["material"]]["pbrMetallicRoughness"]["baseColorFactor"]
        np.testing.assert_allclose(factor[:3], linear(np.array(shape.color[:3])), atol=1e-5)
    doors = [node["extras"]["joint"] for node in document["nodes"] if "extras" in node]
    _, values = poses_and_values(scene)
    assert {door["name"]: door["value"] for door in doors} == values
    for entry in document["accessors"]:
        assert document["bufferViews"][entry["bufferView"]]["byteOffset"] % 4 == 0


def test_linear_light() -> None:
    np.testing.assert_allclose(linear(np.array([0.0, 0.04045, 0.5, 1.0])), [0, 0.0031308, 0.2140411, 1], atol=1e-6)


def test_mcap_places_every_link_and_shows_it(scene: Path) -> None:
    messages = {}
    with (scene / "scene.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            messages[channel.topic] = (schema.name, message.data)
    assert {topic: name for topic, (name, _) in messages.items()} == {
        "/tf": "foxglove.FrameTransforms",
        "/scene": "foxglove.SceneUpdate",
    }
    poses, _ = poses_and_values(scene)
    found = {"world": np.eye(4)}
    for entry in FrameTransforms.FromString(messages["/tf"][1]).transforms:
        found[entry.child_frame_id] = found[entry.parent_frame_id] @ transform_matrix(entry.translation, entry.rotation)
    assert found.keys() == poses.keys()
    for link, pose in poses.items():
        np.testing.assert_allclose(found[link], pose, atol=1e-6)
    entities = {entity.id: entity for entity in SceneUpdate.FromString(messages["/scene"][1]).entities}
    urdf = parse_urdf(scene / "scene.urdf")
    assert entities.keys() == {link.name for link in urdf.links if link.visuals}
    cup = entities["cup_5"]
    assert cup.frame_id == "cup_5" and len(cup.triangles) == len(urdf.link("cup_5").visuals)
    for triangles in cup.triangles:
        assert max(triangles.indices) < len(triangles.points) and len(triangles.indices) % 3 == 0


def test_srdf_disables_what_is_joined_and_what_touches(scene: Path) -> None:
    root = ElementTree.parse(scene / "scene.srdf").getroot()
    reasons = {
        (entry.get("link1"), entry.get("link2")): entry.get("reason") for entry in root.findall("disable_collisions")
    }
    assert reasons[("fridge_4", "fridge_4__door")] == "Adjacent"
    assert reasons[("cup_5", "table_3")] == "Adjacent"  # on a floating joint
    assert ("cup_5", "fridge_4") not in reasons
    links = {link.name for link in parse_urdf(scene / "scene.urdf").links}
    assert all(first < second and {first, second} <= links for first, second in reasons)
    _, values = poses_and_values(scene)
    state = {entry.get("name"): float(entry.get("value")) for entry in root.findall("group_state/joint")}
    assert state == pytest.approx(values)


def test_the_moved_folder_loads_in_bullet_and_mujoco(scene: Path) -> None:
    with load_scene(scene) as world:
        assert len(world.bodies) == 7
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(scene / "scene.mjcf.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    poses, _ = poses_and_values(scene)
    for link, pose in poses.items():
        if link != "world":
            np.testing.assert_allclose(data.body(link).xpos, pose[:3, 3], atol=1e-6)
    assert str(scene) not in "".join(file.read_text() for file in scene.glob("*.urdf"))


def test_the_same_scene_gives_the_same_bytes(made: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    shutil.copytree(made, again)
    for name in ("scene.srdf", "scene.glb", "scene.mcap"):
        (again / name).unlink()
    write_exports(again, InteractiveSceneFile.read(again / "scene.json"))
    for name in ("scene.srdf", "scene.glb", "scene.mcap"):
        assert (again / name).read_bytes() == (made / name).read_bytes()
    assert settle_report(made, 0.2) == settle_report(again, 0.2)


def test_bullet_and_mujoco_agree_on_what_stays(scene: Path) -> None:
    """One cup hangs in the air at 1 m, the other and the bottle stand."""
    pytest.importorskip("mujoco")
    by_bullet = settle_report(scene, 1.5).bodies
    by_mujoco = mujoco_motions(scene, 1.5)
    assert [body.name for body in by_bullet] == [body.name for body in by_mujoco] == ["cup_5", "bottle_6", "cup_7"]
    assert [body.stays for body in by_bullet] == [body.stays for body in by_mujoco] == [True, True, False]
    assert by_mujoco[2].moved == pytest.approx(by_bullet[2].moved, abs=0.02) == pytest.approx(0.99, abs=0.02)
    assert not any(body.fell_through for body in by_mujoco)


def test_mujoco_finds_what_falls_through(scene: Path) -> None:
    pytest.importorskip("mujoco")
    path = scene / "scene.mjcf.xml"
    document = ElementTree.parse(path)
    floor = document.find(".//body[@name='floor_1']")
    assert floor is not None
    slab = next(geom for geom in floor.findall("geom") if geom.get("class") == "collision")
    slab.set("size", "0.01 0.01 0.05")
    document.write(path)
    fallen = {body.name: body.fell_through for body in mujoco_motions(scene, 1.5)}
    assert fallen == {"cup_5": False, "bottle_6": False, "cup_7": True}


def test_a_scene_that_mujoco_does_not_load_is_bad_input(scene: Path) -> None:
    pytest.importorskip("mujoco")
    (scene / "scene.mjcf.xml").write_text("<mujoco><worldbody/>")
    with pytest.raises(BadInput, match="MuJoCo does not load it"):
        mujoco_motions(scene, 0.1)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('body name="floor_1"', 'body name="floor_9"', "there is no body floor_1, which scene.json names"),
        ('body name="cup_5"', 'body name="cup_9"', "there is no body cup_5, which scene.json names"),
        ('key name="reconstructed"', 'key name="home"', "there is no key frame reconstructed, only home"),
    ],
)
def test_a_file_of_another_run_is_bad_input(scene: Path, old: str, new: str, said: str) -> None:
    pytest.importorskip("mujoco")
    path = scene / "scene.mjcf.xml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(BadInput, match=said) as raised:
        mujoco_motions(scene, 0.1)
    assert raised.value.hint == "run `urdf` again"


def test_a_file_without_any_of_many_bodies_says_how_many(scene: Path) -> None:
    pytest.importorskip("mujoco")
    (scene / "scene.mjcf.xml").write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(BadInput, match="there is no body [a-z0-9_, ]+ and 1 more, which scene.json names"):
        mujoco_motions(scene, 0.1)

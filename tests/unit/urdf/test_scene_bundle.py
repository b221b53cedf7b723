"""The interactive scene: tree, scale, files, MJCF, and what happens to it in physics."""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest
import trimesh
import yourdfpy
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.formats.urdf_check import check_urdf
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.geometry.transforms import apply, quaternion_of

from tests.unit.urdf.small_room import find, graph_of, layout, placed, room


@pytest.fixture(scope="module")
def bundle(library, tmp_path_factory) -> tuple[Path, InteractiveSceneFile, list[BundleBody]]:
    root = tmp_path_factory.mktemp("scene") / "interactive_scene"
    bodies = room(library)
    return root, write_scene_bundle(root, bodies, graph_of(bodies)), bodies


def test_tree_of_the_combined_scene(bundle):
    root, _, _ = bundle
    urdf = parse_urdf(root / "scene.urdf")
    joints = {joint.child: (joint.parent, joint.type) for joint in urdf.joints}
    assert urdf.roots() == ["world"]
    assert joints == {
        "floor_1": ("world", "fixed"),
        "wall_2": ("world", "fixed"),
        "table_3": ("floor_1", "fixed"),
        "fridge_4": ("floor_1", "fixed"),
        "fridge_4__door": ("fridge_4", "revolute"),
        "cup_5": ("table_3", "floating"),
        "bottle_6": ("fridge_4", "floating"),
        "cup_7": ("floor_1", "floating"),
    }
    for file in [root / "scene.urdf", root / "static.urdf", *sorted((root / "bodies").iterdir())]:
        assert check_urdf(file, root) == []


def test_every_link_is_where_its_body_is(bundle):
    root, scene, bodies = bundle
    robot = yourdfpy.URDF.load(str(root / "scene.urdf"))
    values = {name: value for body in scene.bodies for name, value in body.joint_values.items()}
    assert values == {"fridge_4__door_hinge": 1.2}
    robot.update_cfg(values)
    for body in bodies:
        assert robot.get_transform(body.name, "world") == pytest.approx(body.world_from_body, abs=1e-7)
    fridge = next(body for body in bodies if body.name == "fridge_4")
    assert fridge.model is not None and fridge.model_folder is not None
    expected = posed_mesh(fridge.model_folder, fridge.model, fridge.joint_values)
    expected.apply_transform(fridge.world_from_body)
    found = np.concatenate(
        [
            trimesh.transform_points(mesh.vertices, robot.scene.graph[node][0])
            for node, name in ((n, robot.scene.graph[n][1]) for n in robot.scene.graph.nodes_geometry)
            for mesh in [robot.scene.geometry[name]]
            if robot.scene.graph.transforms.parents[node].startswith("fridge_4")
        ]
    )
    assert np.ptp(found, axis=0) == pytest.approx(np.ptp(expected.vertices, axis=0), abs=1e-5)
    assert found.min(axis=0) == pytest.approx(expected.bounds[0], abs=1e-5)


def test_static_tree_holds_no_movable_and_each_movable_has_a_file(bundle):
    root, scene, _ = bundle
    static = parse_urdf(root / "static.urdf")
    assert {link.name for link in static.links} == {
        "world",
        "floor_1",
        "wall_2",
        "table_3",
        "fridge_4",
        "fridge_4__door",
    }
    assert {joint.type for joint in static.joints} == {"fixed", "revolute"}
    assert {body.file for body in scene.bodies if body.movable} == {
        f"bodies/{n}.urdf" for n in ("cup_5", "bottle_6", "cup_7")
    }
    for body in scene.bodies:
        if body.file:
            own = parse_urdf(root / body.file)
            assert [link.name for link in own.links] == [body.name]
            inertial = own.links[0].inertial
            assert inertial is not None
            assert body.mass == pytest.approx(inertial.mass, rel=1e-6)


def test_uniform_scale_obeys_its_rules(library, tmp_path):
    scale = 1.3
    drawers = next(m for m in library.info.models if any(j.type == "prismatic" for j in m.joints))
    hinged = next(m for m in library.info.models if m.class_name == "fridge")
    bodies = [
        placed(library, "cabinet_1", drawers.id, (0, 0, 0), scale=scale, joints={drawers.joints[0].name: 0.2}),
        placed(library, "fridge_2", hinged.id, (2, 0, 0), scale=scale, joints={hinged.joints[0].name: 0.5}),
    ]
    scene = write_scene_bundle(tmp_path, bodies, graph_of(bodies))
    urdf = parse_urdf(tmp_path / "static.urdf")
    for body, model in zip(bodies, (drawers, hinged), strict=True):
        source = parse_urdf(model_folder(library, model.id) / "model.urdf")
        record = next(entry for entry in scene.bodies if entry.name == body.name)
        for joint, ours in zip(model.joints, record.joints, strict=True):
            found = next(j for j in urdf.joints if j.name == f"{body.name}__{joint.name}")
            length = scale if joint.type == "prismatic" else 1.0
            assert found.upper == pytest.approx(joint.upper * length, rel=1e-6)
            assert found.parent_from_child[:3, 3] == pytest.approx(np.array(joint.origin) * scale, abs=1e-7)
            assert (ours.name, ours.part) == (found.name, found.child)
            assert ours.upper == pytest.approx(found.upper)
            assert ours.handle == pytest.approx(np.array(joint.handle) * scale)
        for part in model.parts:
            name = body.name if part == model.parts[0] else f"{body.name}__{part}"
            before, after = source.link(part).inertial, urdf.link(name).inertial
            assert before is not None and after is not None
            assert after.mass == pytest.approx(before.mass * scale**3, rel=1e-6)
            assert after.center == pytest.approx(before.center * scale, abs=1e-7)
            assert after.inertia == pytest.approx(before.inertia * scale**5, rel=1e-6, abs=1e-8)
        assert record.mass == pytest.approx(model.mass * scale**3, rel=1e-5)
    values = {name: value for entry in scene.bodies for name, value in entry.joint_values.items()}
    assert values[f"cabinet_1__{drawers.joints[0].name}"] == pytest.approx(0.2 * scale)
    assert values[f"fridge_2__{hinged.joints[0].name}"] == pytest.approx(0.5)
    robot = yourdfpy.URDF.load(str(tmp_path / "static.urdf"))
    robot.update_cfg({**dict.fromkeys(robot.actuated_joint_names, 0.0), **values})
    for body, model in zip(bodies, (drawers, hinged), strict=True):
        assert body.model_folder is not None
        expected = posed_mesh(body.model_folder, model, body.joint_values, scale)
        part = model.joints[0].part
        frame = robot.get_transform(f"{body.name}__{part}", body.name)
        folder = body.model_folder
        mesh = trimesh.load(folder / "visual" / f"{part}.glb", force="mesh", process=False)
        moved = apply(frame, np.asarray(mesh.vertices) * scale)
        assert np.abs(moved[:, None, :] - expected.vertices[None]).max(axis=2).min(axis=1).max() < 1e-5


def simulate(root: Path, scene: InteractiveSceneFile, seconds: float) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Load static tree and bodies into pybullet, step, and return body positions and joint values by name."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        static = pybullet.loadURDF(str(root / scene.static_file), useFixedBase=True, physicsClientId=client)
        values = {name: value for body in scene.bodies for name, value in body.joint_values.items()}
        indices = {}
        for index in range(pybullet.getNumJoints(static, physicsClientId=client)):
            name = pybullet.getJointInfo(static, index, physicsClientId=client)[1].decode()
            if name in values:
                indices[name] = index
                pybullet.resetJointState(static, index, values[name], physicsClientId=client)
                pybullet.setJointMotorControl2(
                    static, index, pybullet.VELOCITY_CONTROL, force=0.5, physicsClientId=client
                )
        ids = {}
        for body in scene.bodies:
            if body.file:
                pose = np.array(body.world_from_body)
                flags = pybullet.URDF_USE_INERTIA_FROM_FILE
                ids[body.name] = pybullet.loadURDF(str(root / body.file), flags=flags, physicsClientId=client)
                offset = pybullet.getDynamicsInfo(ids[body.name], -1, physicsClientId=client)[3:5]
                place = pybullet.multiplyTransforms(pose[:3, 3].tolist(), quaternion_of(pose).tolist(), *offset)
                pybullet.resetBasePositionAndOrientation(ids[body.name], *place, physicsClientId=client)
        for _ in range(round(seconds * 240)):
            pybullet.stepSimulation(physicsClientId=client)
        positions = {}
        for name, number in ids.items():
            offset = pybullet.getDynamicsInfo(number, -1, physicsClientId=client)[3:5]
            now = pybullet.getBasePositionAndOrientation(number, physicsClientId=client)
            back = pybullet.multiplyTransforms(*now, *pybullet.invertTransform(*offset))
            positions[name] = np.array(back[0])
        joints = {n: pybullet.getJointState(static, i, physicsClientId=client)[0] for n, i in indices.items()}
        return positions, joints
    finally:
        pybullet.disconnect(client)


def test_what_is_supported_stays_and_what_is_not_falls(bundle):
    root, scene, bodies = bundle
    start = {body.name: body.world_from_body[:3, 3] for body in bodies}
    positions, joints = simulate(root, scene, 2.0)
    assert np.linalg.norm(positions["cup_5"] - start["cup_5"]) < 0.006, "the cup on the table moved"
    assert np.linalg.norm(positions["bottle_6"] - start["bottle_6"]) < 0.006, "the bottle in the fridge moved"
    floor = 0.01
    assert positions["cup_7"][2] == pytest.approx(floor, abs=0.006), "the cup in the air did not fall to the floor"
    assert positions["cup_7"][:2] == pytest.approx(start["cup_7"][:2], abs=0.02)
    assert joints["fridge_4__door_hinge"] == pytest.approx(1.2, abs=0.02)


def test_a_ball_rolls_into_the_open_fridge_because_it_is_hollow(bundle):
    root, scene, _ = bundle
    fridge = next(body for body in scene.bodies if body.name == "fridge_4")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        static = pybullet.loadURDF(str(root / "static.urdf"), useFixedBase=True, physicsClientId=client)
        index = next(
            i for i in range(pybullet.getNumJoints(static)) if b"door_hinge" in pybullet.getJointInfo(static, i)[1]
        )
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.05, physicsClientId=client)
        inside = np.array(fridge.world_from_body)[:3, 3] + [0, 0.05, 0.2]
        probe = pybullet.createMultiBody(0, shape, basePosition=inside.tolist(), physicsClientId=client)
        for angle in (0.0, 1.2):
            pybullet.resetJointState(static, index, angle, physicsClientId=client)
            assert pybullet.getClosestPoints(probe, static, 0.0, physicsClientId=client) == ()
            hits = pybullet.rayTest([2.0, -0.5, 0.25], [2.0, 1.0, 0.25], physicsClientId=client)[0]
            assert (hits[0] == -1) == (angle > 0), "the door is closed at 0 and open at 1.2 rad"
    finally:
        pybullet.disconnect(client)


def test_the_bundle_can_be_moved_and_loads_there(bundle, tmp_path):
    root, scene, _ = bundle
    shutil.copytree(root, tmp_path / "elsewhere")
    moved = tmp_path / "elsewhere"
    for file in [moved / "scene.urdf", moved / "static.urdf", *sorted((moved / "bodies").iterdir())]:
        assert check_urdf(file, moved) == []
        assert str(root) not in file.read_text()
    assert len(yourdfpy.URDF.load(str(moved / "scene.urdf")).scene.geometry) > 10
    positions, _ = simulate(moved, scene, 0.1)
    assert set(positions) == {"cup_5", "bottle_6", "cup_7"}


def test_same_bodies_same_bytes(library, tmp_path):
    def digest(root: Path) -> str:
        files = sorted(path for path in root.rglob("*") if path.is_file())
        return hashlib.sha256(b"".join(str(f.relative_to(root)).encode() + f.read_bytes() for f in files)).hexdigest()

    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        bodies = room(library)
        write_scene_bundle(tmp_path / name, bodies, graph_of(bodies))
    assert digest(tmp_path / "a") == digest(tmp_path / "b")


def test_mjcf_has_the_same_tree(bundle):
    root, scene, _ = bundle
    tree = ElementTree.parse(root / "scene.mjcf.xml").getroot()
    world = tree.find("worldbody")
    assert world is not None
    parents = {
        child.get("name"): parent.get("name", "world") for parent in world.iter() for child in parent.findall("body")
    }
    assert parents == {
        "floor_1": "world",
        "wall_2": "world",
        "table_3": "floor_1",
        "fridge_4": "floor_1",
        "fridge_4__door": "fridge_4",
        "cup_5": "world",
        "bottle_6": "world",
        "cup_7": "world",
    }
    free = {body.get("name") for body in world.findall("body") if body.find("freejoint") is not None}
    assert free == {"cup_5", "bottle_6", "cup_7"}, "free joints stand right under the world"
    key = tree.find("keyframe/key")
    assert key is not None
    qpos = [float(x) for x in (key.get("qpos") or "").split()]
    assert len(qpos) == 1 + 3 * 7
    order = [e for e in world.iter() if e.tag in ("joint", "freejoint")]
    at, poses = 0, {}
    for element in order:
        width = 7 if element.tag == "freejoint" else 1
        poses[element.get("name")] = qpos[at : at + width]
        at += width
    assert poses["fridge_4__door_hinge"] == [1.2]
    for body in scene.bodies:
        if body.movable:
            pose = np.array(body.world_from_body)
            assert poses[f"{body.name}__support"][:3] == pytest.approx(pose[:3, 3], abs=1e-7)
            assert poses[f"{body.name}__support"][3:] == pytest.approx(quaternion_of(pose)[[3, 0, 1, 2]], abs=1e-7)
    assets = {mesh.get("name"): mesh.get("file") for mesh in tree.findall("asset/mesh")}
    used = {geom.get("mesh") for geom in world.iter("geom") if geom.get("mesh")}
    assert used == set(assets)
    assert all((root / (file or "")).is_file() for file in assets.values())
    for body in world.iter("body"):
        inertial = body.find("inertial")
        assert inertial is not None, body.get("name")
        assert float(inertial.get("mass") or 0) > 0


def test_mujoco_loads_it_where_it_is_installed(bundle):
    mujoco = pytest.importorskip("mujoco")
    root, _, _ = bundle
    model = mujoco.MjModel.from_xml_path(str(root / "scene.mjcf.xml"))
    assert (model.nbody, model.nq, model.nkey) == (9, 22, 1)


def bumpy_sheet(size: float, height: float) -> trimesh.Trimesh:
    """A reconstructed floor: a grid with 1 cm of noise."""
    line = np.linspace(-size / 2, size / 2, 21)
    x, y = np.meshgrid(line, line)
    z = height + np.random.default_rng(0).normal(scale=0.003, size=x.shape)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    at = np.arange(441).reshape(21, 21)
    corners = [at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]]
    a, b, c, d = (grid.ravel() for grid in corners)
    return trimesh.Trimesh(
        vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]), process=False
    )


def test_a_reconstructed_floor_is_solid_below_its_surface(library, tmp_path):
    floor = replace(layout("floor_1", "floor", (0, 0, 0.02), (3, 3, 0.06)), mesh=bumpy_sheet(3.0, 0.004))
    cup = placed(library, "cup_2", "cup_00", (0.3, 0.4, 0.5), parent="floor_1", movable=True)
    scene = write_scene_bundle(tmp_path, [floor, cup], graph_of([floor, cup]))
    positions, _ = simulate(tmp_path, scene, 1.5)
    assert positions["cup_2"][2] == pytest.approx(0.004, abs=0.006)
    shape = parse_urdf(tmp_path / "static.urdf").link("floor_1").collisions[0]
    assert shape.box_size is not None
    assert shape.box_size[2] == pytest.approx(0.2)
    assert min(shape.box_size[:2]) > 3.5, "the floor goes on beyond what was seen"


def test_the_floor_is_where_the_plane_that_carries_things_is(library, tmp_path):
    low = SurfacePlane(normal=(0, 0, 1), offset=0.0, area=9.0, center=(0, 0, 0.0), horizontal=True)
    high = SurfacePlane(normal=(0, 0, 1), offset=-0.03, area=1.0, center=(0, 0, 0.03), horizontal=True)
    floor = layout("floor_1", "floor", (0, 0, 0.02), (3, 3, 0.06))
    cup = placed(library, "cup_2", "cup_00", (0, 0, 0.03), parent="floor_1", movable=True)
    graph = graph_of([floor, cup])
    nodes = tuple(n.model_copy(update={"planes": (low, high)}) if n.id == "floor_1" else n for n in graph.nodes)
    for plane, height in ((None, 0.0), (1, 0.03)):
        links = tuple(
            link.model_copy(update={"plane": plane}) if link.target == "cup_2" else link for link in graph.links
        )
        root = tmp_path / str(plane)
        write_scene_bundle(root, [floor, cup], graph.model_copy(update={"nodes": nodes, "links": links}))
        shape = parse_urdf(root / "static.urdf").link("floor_1").collisions[0]
        assert shape.link_from_shape[2, 3] + 0.1 == pytest.approx(height, abs=1e-9)


def test_walls_of_one_entity_leave_the_room_free(tmp_path):
    """Four walls reconstructed as one mesh: slabs behind each surface, nothing in the middle of the room."""
    outer = trimesh.creation.box((4, 3, 2.5))
    outer.apply_translation([0, 0, 1.25])
    upright = np.abs(outer.face_normals[:, 2]) < 0.5
    walls = outer.submesh([np.flatnonzero(upright)], append=True)
    walls.invert()
    for _ in range(4):
        walls = walls.subdivide()
    body = replace(layout("wall_1", "wall", (0, 0, 1.25), (4, 3, 2.5)), mesh=walls)
    write_scene_bundle(tmp_path, [body], graph_of([body]))
    shapes = parse_urdf(tmp_path / "static.urdf").link("wall_1").collisions
    assert len(shapes) == 4
    centers = np.array([shape.link_from_shape[:3, 3] for shape in shapes])
    assert sorted(np.round(np.abs(centers[:, :2]).max(axis=1), 2)) == pytest.approx([1.55, 1.55, 2.05, 2.05], abs=0.02)
    for shape in shapes:
        corners = (
            np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * np.array(shape.box_size) / 2
        )
        placed_corners = apply(shape.link_from_shape, corners)
        inner = (np.abs(placed_corners[:, 0]) < 1.96) & (np.abs(placed_corners[:, 1]) < 1.46)
        assert not inner.any()


def test_things_without_model_keep_their_mesh_and_collide_as_their_hull(tmp_path):
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    mesh.apply_translation([0, 0, 0.1])
    mesh.visual.vertex_colors = [10, 200, 30, 255]
    floor = layout("floor_1", "floor", (0, 0, -0.01), (2, 2, 0.02))
    pose = np.eye(4)
    pose[:3, 3] = [0.2, 0.1, 0.5]
    ball = replace(
        layout("box_2", "box", (0.2, 0.1, 0.6), (0.2, 0.2, 0.2)),
        parent="floor_1",
        movable=True,
        mesh=mesh,
        world_from_body=pose,
        mass=0.7,
    )
    flat = replace(ball, name="book_3", class_name="book", mesh=bumpy_sheet(0.2, 0.0), mass=None)
    unknown = replace(layout("object_4", "object", (-0.6, 0, 0.1), (0.2, 0.2, 0.2)), parent="floor_1")
    bodies = [floor, ball, flat, unknown]
    scene = write_scene_bundle(tmp_path, bodies, graph_of(bodies))
    masses = {body.name: body.mass for body in scene.bodies}
    assert masses["box_2"] == pytest.approx(0.7)
    assert 0 < masses["book_3"] < 1
    assert masses["object_4"] == pytest.approx(0.2**3 * 200)
    visual = parse_urdf(tmp_path / "bodies/box_2.urdf").links[0].visuals[0]
    assert visual.color == pytest.approx((10 / 255, 200 / 255, 30 / 255, 1), abs=1e-3)
    assert check_urdf(tmp_path / "bodies/book_3.urdf", tmp_path) == []
    positions, _ = simulate(tmp_path, without(scene, "book_3"), 1.5)
    assert positions["box_2"][2] == pytest.approx(0.0, abs=0.01), "the ball rests on the floor"


def without(scene: InteractiveSceneFile, *names: str) -> InteractiveSceneFile:
    return scene.model_copy(update={"bodies": tuple(body for body in scene.bodies if body.name not in names)})


def test_a_reconstructed_container_keeps_its_contents(library, tmp_path):
    """A bin that stayed a mesh: a hull would throw the cup out, boxes over its surface leave it where it is."""
    mesh = trimesh.creation.box((0.5, 0.5, 0.4))
    mesh.update_faces(mesh.face_normals[:, 2] < 0.5)
    mesh.apply_translation([0, 0, 0.2])
    bin_body = replace(layout("bin_1", "bin", (0, 0, 0.2), (0.5, 0.5, 0.4)), mesh=mesh)
    cup = placed(library, "cup_2", "cup_00", (0.05, 0, 0.005), parent="bin_1", relation="contains", movable=True)
    scene = write_scene_bundle(tmp_path, [bin_body, cup], graph_of([bin_body, cup]))
    positions, _ = simulate(tmp_path, scene, 1.5)
    assert positions["cup_2"] == pytest.approx([0.05, 0, 0.005], abs=0.01)


def test_a_fixed_thing_on_a_movable_one_stands_in_the_static_tree(library, tmp_path):
    table = replace(placed(library, "table_1", "table_00", (0, 0, 0)), movable=True)
    fridge = placed(library, "fridge_2", "fridge_00", (0, 0, 0.8), parent="table_1")
    write_scene_bundle(tmp_path, [fridge, table], graph_of([fridge, table]))
    static = {joint.child: joint.parent for joint in parse_urdf(tmp_path / "static.urdf").joints}
    combined = {joint.child: (joint.parent, joint.type) for joint in parse_urdf(tmp_path / "scene.urdf").joints}
    assert static["fridge_2"] == "world"
    assert combined["fridge_2"] == ("table_1", "fixed")
    assert combined["table_1"] == ("world", "floating")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "two words"}, "not usable"),
        ({"name": "t\u00fcr_1"}, "not usable"),
        ({"name": "world"}, "not usable"),
        ({"parent": "ghost_9"}, "ghost_9"),
        ({"parent": "cup_1"}, "circle"),
        ({"scale": 0.0}, "scale"),
        ({"scale": float("nan")}, "scale"),
        ({"mass": -1.0}, "mass"),
        ({"world_from_body": np.full((4, 4), np.nan)}, "rigid"),
        ({"world_from_body": np.diag([2.0, 2.0, 2.0, 1.0])}, "rigid"),
        ({"model_folder": None}, "folder"),
        ({"class_name": "unicorn", "model": None, "model_folder": None}, "unicorn"),
    ],
)
def test_broken_bodies_are_bad_input(library, tmp_path, change, message):
    body = replace(placed(library, "cup_1", "cup_00", (0, 0, 0), movable=True), **change)
    with pytest.raises(BadInput, match=message):
        write_scene_bundle(tmp_path, [body], graph_of([]))


def test_two_bodies_of_one_name_are_bad_input(library, tmp_path):
    body = placed(library, "cup_1", "cup_00", (0, 0, 0), movable=True)
    with pytest.raises(BadInput, match="two bodies"):
        write_scene_bundle(tmp_path, [body, body], graph_of([]))


def damaged_model(library, tmp_path: Path, old: str, new: str) -> BundleBody:
    folder = tmp_path / "model"
    shutil.copytree(model_folder(library, "cup_00"), folder)
    urdf = folder / "model.urdf"
    text = urdf.read_text()
    assert old in text
    urdf.write_text(text.replace(old, new, 1))
    return replace(placed(library, "cup_1", "cup_00", (0, 0, 0), movable=True), model_folder=folder)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<mass value="', '<mass value="-', "mass"),
        ('ixx="', 'ixx="-', "positive definite"),
        ('ixx="0', 'ixx="9', "triangle"),
        ("visual/body_0.obj", "visual/none.obj", "none.obj"),
        ("visual/body_0.obj", "../../outside.obj", "outside"),
        ('<link name="body"', '<link name="corpus"', "no link"),
        ("</robot>", "", "XML"),
    ],
)
def test_broken_models_are_bad_input(library, tmp_path, old, new, message):
    body = damaged_model(library, tmp_path, old, new)
    (tmp_path / "outside.obj").write_text("v 0 0 0\n")
    with pytest.raises(BadInput, match=message):
        write_scene_bundle(tmp_path / "out", [body], graph_of([body]))


def test_an_empty_room_is_written(tmp_path):
    scene = write_scene_bundle(tmp_path, [], graph_of([]))
    assert scene.bodies == ()
    assert parse_urdf(tmp_path / "scene.urdf").roots() == ["world"]


def test_grasp_width_scales(library, tmp_path):
    body = placed(library, "cup_1", "cup_00", (0, 0, 0), movable=True, scale=0.9)
    scene = write_scene_bundle(tmp_path, [body], graph_of([body]))
    width = find(library, "cup_00").grasp_width
    assert width is not None
    assert scene.bodies[0].grasp_width == pytest.approx(0.9 * width)

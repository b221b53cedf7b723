"""Scenes in the formats of others, read by their libraries and simulated where that can be."""

from __future__ import annotations

import importlib.util
import shutil
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest
from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.exported_scene import ExportedScene
from scenewright.schemas.interactive_scene import InteractiveScene, InteractiveSceneFile
from scenewright.stages.export import scene_registry
from scenewright.stages.export.parameters import SceneExportParameters
from scenewright.stages.export.scene_bodies import BodyToExport, SceneToExport
from scenewright.stages.export.scene_formats.usd.writer import _x_onto
from scenewright.stages.export.scene_stage import run
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.kit.formats.written_scene import WrittenScene
from scenewright.stages.kit.geometry.transforms import apply, transform_from
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.exports import write_exports
from scipy.spatial.transform import Rotation

from tests.unit.urdf.small_room import context, graph_of, layout, placed, room, small_library

MOVABLE = ("cup_5", "bottle_6", "cup_7")
DOOR = "fridge_4__door_hinge"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> InteractiveScene:
    """The small room, its fridge ajar."""
    bodies = room(small_library(tmp_path_factory.mktemp("library"), "table", "fridge", "cup", "bottle"))
    root = tmp_path_factory.mktemp("scene")
    write_exports(root, write_scene_bundle(root, bodies, graph_of(bodies)))
    return InteractiveScene(root)


@pytest.fixture(scope="module")
def bodies(scene: InteractiveScene) -> dict[str, BodyToExport]:
    return {body.name: body for body in to_export(scene).bodies}


def to_export(scene: InteractiveScene) -> SceneToExport:
    return SceneToExport(WrittenScene(scene.root, scene.info), scene.graph)


def written(scene: InteractiveScene, target: str, out: Path) -> ExportedScene:
    done = run(scene, parameters=SceneExportParameters(to=target), context=context(out))
    assert done.outcome == "ok" and done.info.target == target and done.path(done.info.file).is_file()
    return done


def stage_of(scene: InteractiveScene, out: Path) -> Usd.Stage:
    return Usd.Stage.Open(str(written(scene, "usd", out).path("scene.usdc")))


def matrix(prim: Usd.Prim) -> np.ndarray:
    """world_from_prim (4, 4); USD has row vectors."""
    return np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T


def test_usd_is_what_the_library_calls_valid(scene: InteractiveScene, tmp_path: Path) -> None:
    stage = stage_of(scene, tmp_path)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert [error.GetErrorAsString() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0


def test_usd_bodies_stand_weigh_and_turn_as_in_the_urdf(
    scene: InteractiveScene, bodies: dict[str, BodyToExport], tmp_path: Path
) -> None:
    stage = stage_of(scene, tmp_path)
    source = to_export(scene)
    for body in bodies.values():
        for link in body.links:
            prim = stage.GetPrimAtPath(f"/World/{body.name}/{link.name}")
            np.testing.assert_allclose(matrix(prim), source.pose(link), atol=1e-6)
            rigid = prim.HasAPI(UsdPhysics.RigidBodyAPI)
            assert rigid == (body.name in MOVABLE or body.name == "fridge_4")
            if rigid:
                assert link.inertial is not None
                mass = UsdPhysics.MassAPI(prim)
                assert mass.GetMassAttr().Get() == pytest.approx(link.inertial.mass)
                w, x, y, z = (
                    mass.GetPrincipalAxesAttr().Get().GetReal(),
                    *mass.GetPrincipalAxesAttr().Get().GetImaginary(),
                )
                axes = Rotation.from_quat([x, y, z, w]).as_matrix()
                tensor = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
                np.testing.assert_allclose(tensor, link.inertial.inertia, rtol=1e-4, atol=1e-7)
            for number, shape in enumerate(link.collisions):
                points = _collider_points(stage, f"{prim.GetPath()}/collision_{number}")
                expected = _corners(shape, scene.root)
                np.testing.assert_allclose(points, apply(source.pose(link), expected), atol=1e-5)


def _collider_points(stage: Usd.Stage, path: str) -> np.ndarray:
    prim = stage.GetPrimAtPath(path)
    assert prim.HasAPI(UsdPhysics.CollisionAPI)
    if prim.IsA(UsdGeom.Cube):
        return apply(matrix(prim), _unit_corners())
    return apply(matrix(prim), np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get()))


def _unit_corners() -> np.ndarray:
    return np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def _corners(shape, root: Path) -> np.ndarray:
    if shape.box_size is not None:
        return apply(shape.link_from_shape, _unit_corners() * shape.box_size)
    return apply(shape.link_from_shape, shape.scale * np.asarray(read_mesh(root / shape.mesh).vertices))


def test_usd_joints_hold_their_bodies_together(scene: InteractiveScene, bodies, tmp_path: Path) -> None:
    stage = stage_of(scene, tmp_path)
    parsed = UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/World"])
    counts = {str(kind).rpartition(".")[2]: len(paths) for kind, (paths, _) in parsed.items()}
    assert counts["Articulation"] == 1 and counts["RigidBody"] == 3 + len(bodies["fridge_4"].links)
    hinge = next(joint for joint in bodies["fridge_4"].joints if joint.name == DOOR)
    prim = stage.GetPrimAtPath(f"/World/fridge_4/{DOOR}")
    joint = UsdPhysics.RevoluteJoint(prim)
    assert joint.GetLowerLimitAttr().Get() == pytest.approx(np.degrees(hinge.lower))
    assert joint.GetUpperLimitAttr().Get() == pytest.approx(np.degrees(hinge.upper))
    sides = []
    for body, place, turn in (
        (joint.GetBody0Rel(), joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
        (joint.GetBody1Rel(), joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
    ):
        w, (x, y, z) = turn.Get().GetReal(), turn.Get().GetImaginary()
        local = transform_from(Rotation.from_quat([x, y, z, w]).as_matrix(), np.array(place.Get()))
        sides.append(matrix(stage.GetPrimAtPath(body.GetTargets()[0])) @ local)
    between = np.linalg.inv(sides[0]) @ sides[1]
    np.testing.assert_allclose(between[:3, 3], 0, atol=1e-5)
    value = scene.info.bodies[[b.name for b in scene.info.bodies].index("fridge_4")].joint_values[DOOR]
    np.testing.assert_allclose(Rotation.from_matrix(between[:3, :3]).as_rotvec(), [value, 0, 0], atol=1e-5)


@pytest.mark.parametrize("axis", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, -1), (0.6, 0.0, 0.8)])
def test_the_axis_of_a_joint_is_its_x(axis: tuple[float, float, float]) -> None:
    turn = _x_onto(np.array(axis, dtype=float))
    np.testing.assert_allclose(turn @ [1, 0, 0], axis, atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)


def test_the_same_scene_gives_the_same_bytes(scene: InteractiveScene, tmp_path: Path) -> None:
    for target in ("usd", "sdf", "moveit"):
        first, second = (written(scene, target, tmp_path / f"{target}{k}") for k in range(2))
        assert first.path(first.info.file).read_bytes() == second.path(second.info.file).read_bytes()


def test_sdf_stands_and_turns_as_the_urdf(scene: InteractiveScene, bodies, tmp_path: Path) -> None:
    done = written(scene, "sdf", tmp_path)
    world = ElementTree.parse(done.path("scene.sdf")).getroot().find("world")
    source = to_export(scene)
    for body in bodies.values():
        model = world.find(f"model[@name='{body.name}']")
        assert (model.find("static") is None) == body.dynamic
        for link in body.links:
            entry = model.find(f"link[@name='{link.name}']")
            np.testing.assert_allclose(_pose_of(model) @ _pose_of(entry), source.pose(link), atol=1e-8)
            for mesh in entry.iter("uri"):
                assert (tmp_path / mesh.text).is_file()
    value = done.info.joint_zero[DOOR]
    hinge = next(joint for joint in bodies["fridge_4"].joints if joint.name == DOOR)
    limit = world.find(f".//joint[@name='{DOOR}']/axis/limit")
    assert float(limit.find("lower").text) == pytest.approx(hinge.lower - value)
    assert float(limit.find("upper").text) == pytest.approx(hinge.upper - value)


def _pose_of(element: ElementTree.Element) -> np.ndarray:
    values = [float(word) for word in element.find("pose").text.split()]
    return transform_from(Rotation.from_euler("xyz", values[3:]).as_matrix(), np.array(values[:3]))


def test_sdf_comes_to_rest_where_the_urdf_does(scene: InteractiveScene, tmp_path: Path) -> None:
    """Bullet reads no joint to the world: the fridge and what is in it are left out."""
    done = written(scene, "sdf", tmp_path)
    tree = ElementTree.parse(done.path("scene.sdf"))
    world_element = tree.getroot().find("world")
    for name in ("fridge_4", "bottle_6"):
        world_element.remove(world_element.find(f"model[@name='{name}']"))
    tree.write(done.path("scene.sdf"))
    with load_scene(scene.root) as world:
        world.settle(2.0)
        ours = {name: world.center_of_mass(name) for name in ("cup_5", "cup_7")}
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        loaded = pybullet.loadSDF(str(done.path("scene.sdf")), physicsClientId=client)
        names = {pybullet.getBodyInfo(k, client)[1].decode(): k for k in loaded}
        pybullet.setTimeStep(1 / 240, physicsClientId=client)
        for _ in range(480):
            pybullet.stepSimulation(client)
        for name, place in ours.items():
            found = pybullet.getBasePositionAndOrientation(names[name], client)[0]
            np.testing.assert_allclose(found, place[:3, 3], atol=0.005, err_msg=name)
    finally:
        pybullet.disconnect(client)


def test_moveit_scene_holds_every_collision_shape(scene: InteractiveScene, bodies, tmp_path: Path) -> None:
    lines = iter(written(scene, "moveit", tmp_path).path("scene.scene").read_text().splitlines())
    source = to_export(scene)
    assert next(lines) == "scene"
    found = {}
    for line in lines:
        if line == ".":
            break
        name, object_pose = line.removeprefix("* "), _moveit_pose(lines)
        shapes = [_moveit_shape(lines, object_pose) for _ in range(int(next(lines)))]
        subframes = {next(lines): object_pose @ _moveit_pose(lines) for _ in range(int(next(lines)))}
        found[name] = (shapes, subframes)
    assert list(lines) == [] and found.keys() == bodies.keys()
    for name, (shapes, subframes) in found.items():
        expected = [
            apply(source.pose(link), _corners(shape, scene.root))
            for link in bodies[name].links
            for shape in link.collisions
        ]
        for points, corners in zip(shapes, expected, strict=True):
            np.testing.assert_allclose(points.min(axis=0), corners.min(axis=0), atol=1e-5)
            np.testing.assert_allclose(points.max(axis=0), corners.max(axis=0), atol=1e-5)
        for link in bodies[name].links[1:]:
            np.testing.assert_allclose(subframes[link.name], source.pose(link), atol=1e-7)


def _moveit_pose(lines) -> np.ndarray:
    place, turn = ([float(word) for word in next(lines).split()] for _ in range(2))
    return transform_from(Rotation.from_quat(turn).as_matrix(), np.array(place))


def _moveit_shape(lines, object_pose: np.ndarray) -> np.ndarray:
    if next(lines) == "box":
        points = _unit_corners() * [float(word) for word in next(lines).split()]
    else:
        vertices, triangles = (int(word) for word in next(lines).split())
        points = np.array([[float(word) for word in next(lines).split()] for _ in range(vertices)])
        faces = np.array([[int(word) for word in next(lines).split()] for _ in range(triangles)])
        assert faces.max() < vertices
    pose = _moveit_pose(lines)
    assert len(next(lines).split()) == 4
    return apply(object_pose @ pose, points)


@pytest.mark.skipif(importlib.util.find_spec("spark_dsg") is None, reason="needs spark_dsg")
def test_hydra_reads_its_graph(scene: InteractiveScene, tmp_path: Path) -> None:
    import spark_dsg

    done = written(scene, "hydra", tmp_path)
    graph = spark_dsg.DynamicSceneGraph.load(str(done.path("scene_graph.json")))
    records = {body.name: body for body in scene.info.bodies}
    objects = {node.attributes.name: node for node in graph.get_layer(spark_dsg.DsgLayers.OBJECTS).nodes}
    assert objects.keys() == {name for name in records if records[name].class_name not in ("floor", "wall")}
    labels = graph.get_labelspace(spark_dsg.DsgLayers.OBJECTS)
    for name, node in objects.items():
        box = node.attributes.bounding_box
        np.testing.assert_allclose(box.world_P_center, records[name].box.center, atol=1e-5)
        np.testing.assert_allclose(box.dimensions, records[name].box.size, atol=1e-5)
        assert labels.get_category(node.attributes.semantic_label) == records[name].class_name
    edge = graph.get_edge(objects["table_3"].id.value, objects["cup_5"].id.value)
    assert edge.info.metadata.get()["relation"] == "supports"


def test_a_library_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_registry, "find_spec", lambda module: None)
    with pytest.raises(MissingDependency, match="usd-core is not installed") as raised:
        scene_registry.versions(SceneExportParameters(to="usd"))
    assert raised.value.hint == "pip install 'scenewright[usd]'"
    assert scene_registry.versions(SceneExportParameters(to="sdf")) == {}


def test_a_scene_without_bodies_is_empty(tmp_path: Path) -> None:
    root = tmp_path / "scene"
    root.mkdir()
    write_exports(root, write_scene_bundle(root, [], ContactGraphFile(nodes=graph_of([]).nodes, links=())))
    for declared in scene_registry.scene_formats():
        if declared.extra is None or importlib.util.find_spec(declared.extra.module):
            done = run(
                InteractiveScene(root),
                parameters=SceneExportParameters(to=declared.name),
                context=context(tmp_path / declared.name),
            )
            assert done.outcome == "empty" and done.summary["reason"] == "the scene has no bodies"


@pytest.fixture(scope="module")
def badly_named(tmp_path_factory: pytest.TempPathFactory) -> InteractiveScene:
    """Cups with names that URDF allows: `__cup__` is SDF's own, USD knows neither `-` nor `.` nor a digit first."""
    library = small_library(tmp_path_factory.mktemp("library"), "cup")
    names = ("__cup__", "cup-a.1_1", "cup_a_1_1", "7cup_2")
    bodies = [
        placed(library, name, "cup_00", (0.3 * number, 0, 0), parent="floor_1", movable=True)
        for number, name in enumerate(names)
    ]
    bodies = [layout("floor_1", "floor", (0.5, 0, 0.0), (4.0, 3.0, 0.02)), *bodies]
    root = tmp_path_factory.mktemp("badly_named")
    graph = ContactGraphFile(nodes=graph_of([]).nodes, links=())
    write_exports(root, write_scene_bundle(root, bodies, graph))
    return InteractiveScene(root)


def test_names_that_usd_does_not_allow_stay_apart(badly_named: InteractiveScene, tmp_path: Path) -> None:
    done = written(badly_named, "usd", tmp_path)
    stage = Usd.Stage.Open(str(done.path("scene.usdc")))
    bodies = [prim.GetName() for prim in stage.GetPrimAtPath("/World").GetChildren()]
    where = {old: new for new, old in done.info.names.items()}
    standing = [where.get(name, name) for name in ("__cup__", "cup-a.1_1", "cup_a_1_1", "7cup_2")]
    assert len(set(standing)) == 4 and set(standing) <= set(bodies)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert UsdValidation.ValidationContext(validators).Validate(stage) == []


def test_names_that_sdf_keeps_for_itself(badly_named: InteractiveScene, tmp_path: Path) -> None:
    done = written(badly_named, "sdf", tmp_path)
    tree = ElementTree.parse(done.path("scene.sdf"))
    assert done.info.names == {"of___cup__": "__cup__"}
    names = [element.get("name", "") for element in tree.iter() if element.tag in ("model", "link", "joint")]
    assert not [name for name in names if name.startswith("__") and name.endswith("__")]
    engine = pybullet.connect(pybullet.DIRECT)
    try:
        assert len(pybullet.loadSDF(str(done.path("scene.sdf")), physicsClientId=engine)) == 5
    finally:
        pybullet.disconnect(engine)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["usd", "sdf"])
def test_a_mesh_of_a_million_faces(scene: InteractiveScene, target: str, tmp_path: Path) -> None:
    root = tmp_path / "scene"
    shutil.copytree(scene.root, root)
    cup = next(body for body in to_export(scene).bodies if body.name == "cup_5")
    shape = cup.links[0].visuals[0]
    side = 710
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2) * 1e-4
    corner = np.arange(side * side).reshape(side, side)[:-1, :-1].ravel() + 1
    faces = np.vstack([[corner, corner + 1, corner + side], [corner + 1, corner + side + 1, corner + side]])
    faces = np.hstack([faces[:3], faces[3:]]).T
    with (root / shape.mesh).open("w") as file:
        np.savetxt(file, grid, fmt="v %.4f %.4f 0")
        np.savetxt(file, faces, fmt="f %d %d %d")
    assert len(faces) > 1_000_000
    started = time.process_time()
    done = written(InteractiveScene(root), target, tmp_path / "out")
    assert time.process_time() - started < 120
    if target == "usd":
        stage = Usd.Stage.Open(str(done.path("scene.usdc")))
        meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
        counts = [len(mesh.GetFaceVertexCountsAttr().Get() or ()) for mesh in meshes]
        assert max(counts) == len(faces)
    else:
        assert done.path(shape.mesh).read_bytes() == (root / shape.mesh).read_bytes()


@pytest.mark.parametrize("target", ["usd", "moveit"])
def test_a_torn_mesh_and_a_missing_link_are_bad_input(scene: InteractiveScene, target: str, tmp_path: Path) -> None:
    root = tmp_path / "scene"
    shutil.copytree(scene.root, root)
    mesh = next((root / "meshes").rglob("collision/*.obj"))
    mesh.write_text("v 0 0 nonsense\n")
    with pytest.raises(BadInput, match=mesh.name):
        run(InteractiveScene(root), parameters=SceneExportParameters(to=target), context=context(tmp_path / "a"))
    info = InteractiveSceneFile.read(root / "scene.json")
    stranger = info.bodies[0].model_copy(update={"name": "stranger"})
    info.model_copy(update={"bodies": (*info.bodies, stranger)}).write(root / "scene.json")
    with pytest.raises(BadInput, match="no link 'stranger'"):
        run(InteractiveScene(root), parameters=SceneExportParameters(to=target), context=context(tmp_path / "b"))

"""What is free to move: what an arm carries, and furniture that stands on a plane, laden or not."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene, CadSceneFile
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.scene_parts import Box, Relation, SurfacePlane
from scenewright.stages.kit.formats.cad_models import model_folder
from scenewright.stages.kit.formats.mobility import Mobility, mobility
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.geometry.convex_pieces import convex_pieces
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.urdf.bodies import held_under_fixed, scene_bodies
from scenewright.stages.urdf.giving_way import DEPTH, given_way, written_pieces
from scenewright.stages.urdf.parameters import UrdfParameters
from scenewright.stages.urdf.stage import run

from tests.unit.urdf.small_room import context

FLOOR = SurfacePlane(normal=(0, 0, 1), offset=0.0, area=36.0, center=(0, 0, 0), horizontal=True)
CARRIABLE = frozenset({"cup"})
FREE = Mobility(True, furniture=True)


def graph_with(
    class_name: str, *, gap: float = 0.0, relation: str = "supports", on_top: bool = False, size: float = 0.5
):
    """A floor and one thing on it, `gap` [m] above; a cup on that when `on_top`."""
    box = Box(center=(0.0, 0.0, gap + 0.4), size=(size, size, 0.8 if size < 1 else size))
    box = box.model_copy(update={"center": (0.0, 0.0, gap + 0.5 * box.size[2])})
    top = Box(center=(0.0, 0.0, gap + 0.85), size=(0.1, 0.1, 0.1))
    nodes = [
        GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene"),
        GraphNode(
            id="floor_1",
            instance=1,
            class_name="floor",
            node_type="layout",
            planes=(FLOOR,),
            box=Box(center=(0, 0, 0), size=(6, 6, 0.02)),
        ),
        GraphNode(id="thing_2", instance=2, class_name=class_name, node_type="rigid", box=box),
        GraphNode(id="cup_3", instance=3, class_name="cup", node_type="rigid", box=top),
    ]
    carried = {"source": "floor_1", "relation": relation, "plane": 0}
    if relation == "unknown":
        carried = {"source": SCENE_NODE, "relation": relation, "because": "the floor is far below"}
    links = [
        Relation(source=SCENE_NODE, target="floor_1", relation="supports", confidence=1.0),
        Relation.model_validate({"target": "thing_2", "confidence": 1.0, **carried}),
        Relation(source="thing_2" if on_top else "floor_1", target="cup_3", relation="supports", confidence=1.0),
    ]
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links))


@pytest.mark.parametrize(
    ("graph", "expected"),
    [
        (graph_with("chair"), FREE),
        (graph_with("chair", gap=0.03), FREE),
        (graph_with("chair", gap=0.3), FREE),  # what it needs to stand is another question
        (graph_with("chair", gap=-0.1), Mobility(False)),  # it goes through what is said to carry it
        (graph_with("chair", on_top=True), FREE),
        (graph_with("chair", relation="hangs_from"), Mobility(False)),
        (graph_with("cabinet"), Mobility(False)),
        (graph_with("sink"), Mobility(False)),
        (graph_with("cup", gap=0.3), Mobility(True)),
        (graph_with("object"), FREE),
        (graph_with("object", size=2.6), Mobility(False)),  # a kitchenette in one piece
        (graph_with("sofa", size=1.8), FREE),
        (graph_with("cup", gap=0.3, relation="unknown"), Mobility(False)),
        (graph_with("chair", relation="unknown"), Mobility(False)),
    ],
)
def test_what_is_free(graph: ContactGraphFile, expected: Mobility) -> None:
    node = next(node for node in graph.nodes if node.id == "thing_2")
    assert mobility(graph, node, CARRIABLE, ()) == expected
    assert mobility(graph, node, (), (node.class_name,)) == Mobility(False)


@pytest.mark.parametrize(("class_name", "expected"), [("microwave", FREE), ("desk", FREE), ("fridge", Mobility(False))])
def test_what_has_doors_and_is_not_built_in_is_free(class_name: str, expected: Mobility) -> None:
    graph = graph_with(class_name)
    node = next(node for node in graph.nodes if node.id == "thing_2").model_copy(update={"node_type": "articulated"})
    assert mobility(graph, node, CARRIABLE, ()) == expected


def chair_mesh() -> trimesh.Trimesh:
    """Seat, back and four legs, 0.8 m high, as surfaces."""
    parts = [trimesh.creation.box((0.5, 0.5, 0.06)), trimesh.creation.box((0.5, 0.06, 0.4))]
    parts[0].apply_translation([0, 0, 0.42])
    parts[1].apply_translation([0, 0.22, 0.6])
    for x in (-0.21, 0.21):
        for y in (-0.21, 0.21):
            leg = trimesh.creation.box((0.05, 0.05, 0.39))
            leg.apply_translation([x, y, 0.195])
            parts.append(leg)
    return trimesh.util.concatenate([part.subdivide().subdivide() for part in parts])


def scene_of(root: Path, graph: ContactGraphFile, cup: tuple[float, float, float]) -> CadScene:
    """A scene without models: a floor, a chair, and a box `cup` that is named so, all by their meshes."""
    for folder in ("models", "meshes", "layout"):
        (root / folder).mkdir(parents=True)
    trimesh.creation.box((6, 6, 0.02)).apply_translation([0, 0, -0.01]).export(root / "layout" / "floor_1.ply")
    chair_mesh().export(root / "meshes" / "thing_2.ply")
    trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation(cup).export(root / "meshes" / "cup_3.ply")
    box = Box(center=cup, size=(0.1, 0.1, 0.1))
    moved = tuple(node.model_copy(update={"box": box}) if node.id == "cup_3" else node for node in graph.nodes)
    graph.model_copy(update={"nodes": moved}).write(root / "graph.json")
    CadSceneFile(replacements=(), conflicts_before=0, conflicts_after=0, iterations=0).write(root / "scene.json")
    return CadScene(root)


def test_what_nothing_is_known_to_carry_is_held_and_says_why(tmp_path: Path) -> None:
    graph = graph_with("cup", gap=1.0, relation="unknown", size=1.0)
    scene = scene_of(tmp_path / "cad_scene", graph, (2.0, 0.0, 0.05))
    made = run(scene, parameters=UrdfParameters(), context=context(tmp_path / "out"))
    held = next(body for body in made.info.bodies if body.name == "thing_2")
    assert not held.movable and held.parent is None and held.relation == "unknown"
    assert held.because == "held: nothing is known to carry it: the floor is far below"
    said = [(doubt.name, doubt.says) for doubt in made.info.doubts]
    assert ("thing_2", held.because) in said and {name for name, _ in said} == {"thing_2", "scene"}


def test_a_chair_without_a_model_is_a_body_of_pieces_that_stands(tmp_path: Path) -> None:
    scene = scene_of(tmp_path / "cad_scene", graph_with("chair"), (2.0, 0.0, 0.05))
    made = run(scene, parameters=UrdfParameters(), context=context(tmp_path / "out"))
    assert made.outcome == "ok" and made.summary["movable"] == 2
    chair = next(body for body in made.info.bodies if body.name == "thing_2")
    assert chair.movable and chair.furniture and not chair.carriable and 1.0 < chair.mass < 10.0
    (link,) = [link for link in parse_urdf(made.path("scene.urdf")).links if link.name == "thing_2"]
    assert 3 <= len(link.collisions) <= 9
    for shape in link.collisions:
        piece = trimesh.load(made.root / str(shape.mesh), force="mesh")
        assert piece.is_watertight and piece.volume > 0
    under_seat = np.array([0.0, 0.0, 0.2]) - np.array(chair.world_from_body)[:3, 3]
    pieces = [trimesh.load(made.root / str(shape.mesh), force="mesh") for shape in link.collisions]
    assert not any(piece.contains([under_seat])[0] for piece in pieces), "a hull would fill what is under the seat"


def test_a_laden_chair_is_free_and_keeps_its_load(tmp_path: Path) -> None:
    """The mesh of the seat bulges under the cup; its body ends at the plane that carries the cup."""
    graph = graph_with("chair", on_top=True)
    seat = SurfacePlane(normal=(0, 0, 1), offset=-0.44, area=0.25, center=(0, 0, 0.44), horizontal=True)
    nodes = tuple(node.model_copy(update={"planes": (seat,)}) if node.id == "thing_2" else node for node in graph.nodes)
    links = tuple(link.model_copy(update={"plane": 0}) if link.target == "cup_3" else link for link in graph.links)
    graph = ContactGraphFile(nodes=nodes, links=links)
    scene = scene_of(tmp_path / "cad_scene", graph, (0.0, -0.1, 0.49))
    made = run(scene, parameters=UrdfParameters(), context=context(tmp_path / "out"))
    assert made.outcome == "ok" and made.summary["movable"] == 2 and made.summary["held"] == 0
    assert {body.name for body in made.info.bodies if body.carriable} == {"cup_3"}


def test_a_heap_without_a_name_gives_way_to_a_chair(tmp_path: Path) -> None:
    scene = scene_of(tmp_path / "cad_scene", graph_with("chair"), (2.0, 0.0, 0.05))
    block = trimesh.creation.box((1.0, 0.3, 1.0)).apply_translation([0, 0.35, 0.5])
    block.subdivide().export(scene.root / "meshes" / "surroundings.ply")
    made = run(scene, parameters=UrdfParameters(), context=context(tmp_path / "out"))
    assert made.summary["cut"] == 1 and made.summary["held"] == 0 and made.summary["movable"] == 2
    assert made.outcome == "ok" and made.summary["collisions"] == 0
    pieces = written_pieces(made.root)
    left, before = np.concatenate([piece.points for piece in pieces["surroundings"]]), np.asarray(block.vertices)
    assert left.min(axis=0) == pytest.approx(before.min(axis=0), abs=0.02), "it is cut, not moved"
    assert left.max(axis=0) == pytest.approx(before.max(axis=0), abs=0.02)
    depths = [a.depth(b) for a in pieces["surroundings"] for b in pieces["thing_2"]]
    assert max(depths) <= DEPTH


@pytest.mark.parametrize("mark", [None, "movable"])
def test_a_table_without_legs_is_not_let_go_unless_somebody_says_so(tmp_path: Path, mark: str | None) -> None:
    graph = graph_with("table") if mark is None else marked(graph_with("table"), mark)
    scene = scene_of(tmp_path / "cad_scene", graph, (2.0, 0.0, 0.05))
    top = trimesh.creation.box((0.5, 0.5, 0.06)).apply_translation([0, 0, 0.7])
    top.export(scene.root / "meshes" / "thing_2.ply")
    body = next(b for b in scene_bodies(scene, scene.graph, CARRIABLE) if b.name == "thing_2")
    assert body.movable is (mark is not None)


def test_of_two_meshes_the_larger_is_cut_and_keeps_its_mass(tmp_path: Path) -> None:
    """The cup stands in the seat, 4 cm deep."""
    scene = scene_of(tmp_path / "cad_scene", graph_with("chair"), (0.0, 0.0, 0.46))
    body = {b.name: b for b in scene_bodies(scene, scene.graph, CARRIABLE)}
    root = tmp_path / "out"
    write_scene_bundle(root, list(body.values()), scene.graph)
    before = {b.name: b.mass for b in InteractiveSceneFile.read(root / "scene.json").bodies}
    cut = {b.name: b for b in given_way(root, list(body.values()))}
    assert [name for name, entry in cut.items() if entry.cut] == ["thing_2"]
    again = write_scene_bundle(root, [replace(b, mesh_is_written=True) for b in cut.values()], scene.graph)
    assert {b.name: b.mass for b in again.bodies} == pytest.approx(before)
    assert given_way(root, list(body.values())) == list(body.values()), "nothing is left to cut"


def test_two_models_in_each_other_are_held(tmp_path: Path, library: CadLibrary) -> None:
    """What is known is not cut."""
    scene = scene_of(tmp_path / "cad_scene", graph_with("table"), (2.0, 0.0, 0.05))
    model = next(entry for entry in library.info.models if entry.class_name == "table")
    shutil.copytree(model_folder(library, model.id), scene.root / "models" / model.id)
    known = {"model_id": model.id, "scale": 1.0, "world_from_model": as_transform(np.eye(4))}
    nodes = [node.model_copy(update=known) if node.id == "thing_2" else node for node in scene.graph.nodes]
    moved = known | {"world_from_model": as_transform(transform_from_yaw(0.0, np.array([0.3, 0.1, 0.0])))}
    nodes.append(nodes[2].model_copy(update=moved | {"id": "thing_4", "instance": 4}))
    second = scene.graph.parent_link("thing_2").model_copy(update={"target": "thing_4"})
    graph = ContactGraphFile(nodes=tuple(nodes), links=(*scene.graph.links, second))
    graph.write(scene.root / "graph.json")
    made = run(CadScene(scene.root), parameters=UrdfParameters(), context=context(tmp_path / "out"))
    assert made.summary["held"] == 2 and made.summary["cut"] == 0 and made.summary["movable"] == 1
    assert not (made.root / "bodies" / "thing_2.urdf").exists()


def test_pieces_hold_all_of_a_mesh_and_a_convex_one_is_one() -> None:
    mesh = chair_mesh()
    pieces = convex_pieces(mesh.vertices, mesh.faces)
    assert set(map(tuple, np.concatenate(pieces))) == set(map(tuple, np.asarray(mesh.vertices)[np.unique(mesh.faces)]))
    ball = trimesh.creation.icosphere(subdivisions=3)
    assert len(convex_pieces(ball.vertices, ball.faces)) == 1


def test_what_carries_something_fixed_is_fixed_too() -> None:
    """A table under a tray under a microwave that no arm carries; another table is free."""

    def piece(name: str, parent: str | None, movable: bool, relation: str = "supports") -> BundleBody:
        box = Box(center=(0, 0, 0.5), size=(1, 1, 1))
        return BundleBody(name, "table", parent, relation, np.eye(4), movable, box, furniture=movable)

    bodies = [
        piece("table_1", "floor_9", True),
        piece("tray_2", "table_1", True),
        piece("microwave_3", "tray_2", False),
        piece("table_4", "floor_9", True),
        piece("picture_5", "table_4", False, "carries_on_wall"),
        piece("floor_9", None, False),
    ]
    assert [body.name for body in held_under_fixed(bodies) if body.movable] == ["table_4"]


def marked(graph: ContactGraphFile, mark: str) -> ContactGraphFile:
    nodes = tuple(node.model_copy(update={"mark": mark}) if node.id == "thing_2" else node for node in graph.nodes)
    return graph.model_copy(update={"nodes": nodes})


@pytest.mark.parametrize(
    ("graph", "mark", "expected"),
    [
        (graph_with("chair"), "fixed", Mobility(False)),
        (graph_with("cup"), "fixed", Mobility(False)),
        (graph_with("fridge"), "movable", FREE),
        (graph_with("cup"), "movable", Mobility(True)),
        (graph_with("chair", gap=0.3), "movable", FREE),
        (graph_with("picture", relation="carries_on_wall"), "movable", Mobility(False)),
        (graph_with("cup", relation="unknown"), "movable", Mobility(False)),
    ],
)
def test_what_a_person_marked_is_as_they_said(graph: ContactGraphFile, mark: str, expected: Mobility) -> None:
    graph = marked(graph, mark)
    assert mobility(graph, graph.node("thing_2"), CARRIABLE, ()) == expected

"""The whole step on maps made by hand."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.geometry.boxes import (
    bottom,
    box_iou,
    box_yaw,
    boxes_overlap_volume,
    gravity_aligned_box,
    refined_box,
    top,
)

from tests.panoptic_maps import box_mesh, chair_mesh, floor_mesh, placed, seen_surface, table_mesh

EYES = [(-1.5, -2.0, 1.5), (1.5, -2.0, 1.6), (0.0, 1.8, 1.7)]


def parents(graph: ContactGraphFile) -> dict[str, tuple[str, str]]:
    return {link.target: (link.source, link.relation) for link in graph.links if link.relation != "proximal"}


@pytest.fixture(scope="module")
def room():
    """A table with a chair pushed under it, a book with a bottle on it, a cup, a cabinet on a wall: as cameras above
    see them."""
    meshes = {
        1: floor_mesh((-1.2, -1), (1.5, 1)),
        2: table_mesh((0, 0), yaw=0.3),
        3: chair_mesh((0.2, -0.45), yaw=0.3 + np.pi),
        4: placed(trimesh.creation.cylinder(radius=0.04, height=0.1), (0.2, 0.1, 0.8)),
        5: box_mesh((-0.4, -0.1, 0.75), (-0.1, 0.1, 0.78)),
        6: placed(trimesh.creation.cylinder(radius=0.03, height=0.12), (-0.2, 0, 0.84)),
        7: box_mesh((1.17, -0.3, 1.4), (1.47, 0.3, 2.0)),
        8: box_mesh((1.5, -1, 0), (1.6, 1, 2.2)),
    }
    classes = {1: "floor", 2: "table", 3: "chair", 4: "cup", 5: "book", 6: "bottle", 7: "wall_cabinet", 8: "wall"}
    return seen_surface(meshes, EYES, noise=0.002), classes


def test_room(room, build_graph):
    graph = build_graph(*room)
    assert parents(graph) == {
        "floor_1": ("scene", "supports"),
        "wall_8": ("scene", "supports"),
        "table_2": ("floor_1", "supports"),
        "chair_3": ("floor_1", "supports"),
        "cup_4": ("table_2", "supports"),
        "book_5": ("table_2", "supports"),
        "bottle_6": ("book_5", "supports"),
        "wall_cabinet_7": ("wall_8", "carries_on_wall"),
    }
    assert build_graph.outcome == "ok"
    assert build_graph.summary["objects"] == 6 and build_graph.summary["floor"] == "seen"
    # (2.1) holds exactly after refinement.
    for link in graph.links:
        if link.relation == "supports" and link.plane is not None:
            child, plane = graph.node(link.target).box, graph.node(link.source).planes[link.plane]
            normal = np.array(plane.normal)
            height = -(plane.offset + normal[:2] @ child.center[:2]) / normal[2]
            assert bottom(child) == pytest.approx(height, abs=1e-9)
    # Proximal edges, where boxes intersect and nobody carries the other.
    proximal = {frozenset((link.source, link.target)) for link in graph.links if link.relation == "proximal"}
    assert frozenset(("table_2", "chair_3")) in proximal
    for pair in proximal:
        a, b = (graph.node(name) for name in pair)
        assert boxes_overlap_volume(a.box, b.box) > 0
    # networkx reads the file as it is, and the directed part is a tree.
    loaded = nx.node_link_graph(graph.model_dump(mode="json"), edges="links")
    loaded.remove_edges_from(
        [(u, v, k) for u, v, k, d in loaded.edges(keys=True, data=True) if d["relation"] == "proximal"]
    )
    assert nx.is_arborescence(nx.DiGraph(loaded))


def test_table_planes_and_box(room, build_graph):
    table = build_graph(*room).node("table_2")
    tops = [plane for plane in table.planes if plane.horizontal]
    assert tops[0].center[2] == pytest.approx(0.75, abs=0.005)
    assert tops[0].area == pytest.approx(1.2 * 0.7, rel=0.05)
    assert all(np.dot(p.normal, p.center) + p.offset == pytest.approx(0, abs=0.005) for p in table.planes)
    true = gravity_aligned_box((0, 0, 0.375), (1.2, 0.7, 0.75), 0.3)
    assert box_iou(table.box, true) > 0.95
    assert box_yaw(table.box) == pytest.approx(0.3, abs=0.02)


def test_same_seed_same_bytes(room, build_graph, tmp_path):
    meshes, classes = {k: room[0][k] for k in (2, 4, 5)}, room[1]
    build_graph(meshes, classes)
    first = (tmp_path / "graph" / "graph.json").read_bytes()
    build_graph(meshes, classes)
    assert (tmp_path / "graph" / "graph.json").read_bytes() == first


def test_hidden_plane_under_clutter(build_graph):
    """The camera is below the top of a cupboard: it sees the front, and a box that stands out above it."""
    meshes = {
        1: floor_mesh(),
        2: box_mesh((-0.4, -0.25, 0), (0.4, 0.25, 1.8)),
        3: box_mesh((-0.2, -0.2, 1.8), (0.2, 0.2, 2.1)),
    }
    seen = seen_surface(meshes, [(-0.8, -2.5, 1.5), (0.8, -2.5, 1.5)])
    graph = build_graph(seen, {1: "floor", 2: "cabinet", 3: "box"})
    assert parents(graph)["box_3"] == ("cabinet_2", "supports")
    link = graph.parent_link("box_3")
    plane = graph.node("cabinet_2").planes[link.plane]
    assert plane.hidden and plane.horizontal
    assert plane.center[2] == pytest.approx(1.8, abs=0.02)
    assert build_graph.summary["hidden_planes"] == 1


def test_contained_in_an_open_cupboard(build_graph):
    """A bottle on an inner board, top below the cupboard's top; a second one on its roof."""
    walls = [
        box_mesh((-0.4, 0.23, 0), (0.4, 0.25, 1.2)),
        box_mesh((-0.4, -0.25, 0), (-0.38, 0.25, 1.2)),
        box_mesh((0.38, -0.25, 0), (0.4, 0.25, 1.2)),
        box_mesh((-0.4, -0.25, 0.0), (0.4, 0.25, 0.05)),
        box_mesh((-0.4, -0.25, 0.6), (0.4, 0.25, 0.62)),
        box_mesh((-0.4, -0.25, 1.18), (0.4, 0.25, 1.2)),
    ]
    bottle = trimesh.creation.cylinder(radius=0.035, height=0.25)
    meshes = {
        1: floor_mesh(),
        2: trimesh.util.concatenate(walls),
        3: placed(bottle, (0.1, 0.0, 0.745)),
        4: placed(bottle, (-0.1, 0.0, 1.325)),
    }
    graph = build_graph(seen_surface(meshes, EYES), {1: "floor", 2: "fridge", 3: "bottle", 4: "bottle"})
    assert parents(graph)["bottle_3"] == ("fridge_2", "contains")
    assert parents(graph)["bottle_4"] == ("fridge_2", "supports")
    board = graph.node("fridge_2").planes[graph.parent_link("bottle_3").plane]
    assert board.center[2] == pytest.approx(0.62, abs=0.01)


def test_shelf_boards_are_no_containers_in_other_classes(build_graph):
    meshes = {1: floor_mesh(), 2: table_mesh(), 3: box_mesh((-0.1, -0.1, 0), (0.1, 0.1, 0.3))}
    graph = build_graph(seen_surface(meshes, EYES), {1: "floor", 2: "table", 3: "bin"})
    assert parents(graph)["bin_3"] == ("floor_1", "supports")


def test_legless_chair_reaches_the_floor(build_graph):
    meshes = {1: floor_mesh(), 2: box_mesh((-0.22, -0.22, 0.42), (0.22, 0.22, 0.9))}
    graph = build_graph(meshes, {1: "floor", 2: "chair"})
    node = graph.node("chair_2")
    assert bottom(node.box_observed) == pytest.approx(0.42, abs=0.01)
    assert bottom(node.box) == pytest.approx(0.0, abs=0.005)
    assert top(node.box) == pytest.approx(top(node.box_observed))
    link = graph.parent_link("chair_2")
    assert link.gap == pytest.approx(0.42, abs=0.01)
    unlimited = build_graph(meshes, {1: "floor", 2: "chair"}, maximum_extension=0.3)
    assert bottom(unlimited.node("chair_2").box) == pytest.approx(0.42, abs=0.01)


def test_refined_box_rules():
    box = gravity_aligned_box((1, 2, 1.0), (0.4, 0.3, 0.6), 0.2)
    lower = refined_box(box, 0.5, 1.0)
    assert bottom(lower) == pytest.approx(0.5) and top(lower) == pytest.approx(1.3)
    raised = refined_box(box, 0.73, 1.0)
    assert bottom(raised) == pytest.approx(0.73) and top(raised) == pytest.approx(1.3)
    assert refined_box(box, -0.4, 1.0) == box
    assert refined_box(box, 1.4, 1.0) == box


def test_nearest_wall_wins_whatever_the_order(build_graph):
    """The released code takes min(distance, 0) and so gives everything to the first wall."""
    meshes = {
        1: box_mesh((-2.1, -2, 0), (-2.0, 2, 2.5)),
        2: box_mesh((2.0, -2, 0), (2.1, 2, 2.5)),
        3: box_mesh((1.7, 0, 1.4), (1.99, 0.6, 1.9)),
    }
    graph = build_graph(meshes, {1: "wall", 2: "wall", 3: "wall_cabinet"})
    assert parents(graph)["wall_cabinet_3"] == ("wall_2", "carries_on_wall")
    assert 0.5 <= graph.parent_link("wall_cabinet_3").confidence <= 1.0
    far = build_graph(
        {**meshes, 3: box_mesh((0.0, 0, 1.4), (0.3, 0.6, 1.9))}, {1: "wall", 2: "wall", 3: "wall_cabinet"}
    )
    assert parents(far)["wall_cabinet_3"] == ("scene", "unknown")
    assert far.parent_link("wall_cabinet_3").because


@pytest.mark.parametrize(("name", "parent"), [("wall_cabinet", "wall_1"), ("cabinet", "scene")])
def test_a_wall_cabinet_of_which_the_front_was_seen_hangs_on_its_wall(build_graph, name, parent):
    meshes = {1: box_mesh((2.0, -2, 0), (2.1, 2, 2.5)), 2: box_mesh((1.7, 0, 1.4), (1.75, 0.6, 1.9))}
    assert parents(build_graph(meshes, {1: "wall", 2: name}))[f"{name}_2"][0] == parent
    over = {**meshes, 1: box_mesh((1.0, -1.0, 2.2), (2.4, 1.6, 2.3))}
    assert parents(build_graph(over, {1: "ceiling", 2: name}))[f"{name}_2"][0] == "scene", "no ceiling is as near"


def test_stray_vertices_do_not_stretch_the_box(build_graph):
    chair = box_mesh((-0.2, -0.2, 0), (0.2, 0.2, 0.9))
    leak = box_mesh((1.5, 1.5, 1.0), (1.52, 1.52, 1.05))
    meshes = {1: floor_mesh(), 2: trimesh.util.concatenate([chair, leak])}
    box = build_graph(meshes, {1: "floor", 2: "chair"}).node("chair_2").box
    assert box_iou(box, gravity_aligned_box((0, 0, 0.45), (0.4, 0.4, 0.9), 0.0)) > 0.9
    stretched = build_graph(meshes, {1: "floor", 2: "chair"}, stray_share=0.0, box_trim=0.0).node("chair_2").box
    assert max(stretched.size) > 1.5


def test_missing_floor_is_supposed_only_where_the_map_shows_one(build_graph, tmp_path):
    meshes = {2: box_mesh((-0.2, -0.2, 0), (0.2, 0.2, 0.9))}
    graph = build_graph(meshes, {2: "chair"})
    assert parents(graph) == {"chair_2": ("scene", "unknown")} and build_graph.summary["floor"] == "none"
    assert build_graph.summary["unknown"] == 1

    # The same with a floor in the whole mesh that no entity owns.
    from scenewright.stages.graph.parameters import GraphParameters
    from scenewright.stages.graph.stage import run
    from scenewright.stages.kit.progress import SilentProgress
    from scenewright.stages.kit.stage import Context

    from tests.panoptic_maps import write_map

    panoptic_map = write_map(tmp_path / "other", meshes, {2: "chair"})
    trimesh.util.concatenate([meshes[2], floor_mesh()]).export(panoptic_map.path("mesh.ply"))
    output = tmp_path / "other_graph"
    output.mkdir()
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    artifact = run(panoptic_map, parameters=GraphParameters(), context=context)
    assert artifact.summary["floor"] == "supposed at z = 0"
    assert parents(artifact.info) == {"chair_2": ("floor_3", "supports"), "floor_3": ("scene", "supports")}
    assert artifact.info.node("floor_3").mesh is None


def test_small_entities_and_persons_are_dropped(build_graph):
    meshes = {
        1: floor_mesh(),
        2: box_mesh((0, 0, 0), (0.012, 0.012, 0.012)),
        3: box_mesh((1, 1, 0), (1.4, 1.4, 1.7)),
        4: trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False),
    }
    graph = build_graph(meshes, {1: "floor", 2: "cup", 3: "person", 4: "box"})
    assert [node.id for node in graph.nodes] == ["scene", "floor_1"]
    assert build_graph.summary["dropped"] == 3


def test_empty_map_is_an_empty_graph(build_graph):
    graph = build_graph({}, {})
    assert build_graph.outcome == "empty"
    assert [node.id for node in graph.nodes] == ["scene"] and graph.links == ()


def test_thesis_method_leaves_corrections_out(room, build_graph):
    graph = build_graph(*room, method="thesis")
    assert graph.graph["method"] == "thesis"
    loaded = parents(graph)
    assert loaded["cup_4"][0] == "table_2"
    assert set(loaded) == {node.id for node in graph.nodes if node.id != "scene"}

"""Plane, gap, overlap and contact of every type of relation, against what a room made by hand gives in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.graph.evidence import EVERY, Surfaces, polygon_middle, share_inside, shared_middle
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.panoptic_maps import box_mesh, floor_mesh, placed, table_mesh, write_map

TILT = 0.3


def open_cupboard() -> trimesh.Trimesh:
    """0.8 x 0.5 x 1.2 m, open to the front, one inner board whose top is at 0.62 m."""
    walls = [
        box_mesh((-0.4, 0.23, 0), (0.4, 0.25, 1.2)),
        box_mesh((-0.4, -0.25, 0), (-0.38, 0.25, 1.2)),
        box_mesh((0.38, -0.25, 0), (0.4, 0.25, 1.2)),
        box_mesh((-0.4, -0.25, 0), (0.4, 0.25, 0.05)),
        box_mesh((-0.4, -0.25, 0.6), (0.4, 0.25, 0.62)),
        box_mesh((-0.4, -0.25, 1.18), (0.4, 0.25, 1.2)),
    ]
    return trimesh.util.concatenate(walls)


def leaning_board() -> trimesh.Trimesh:
    """1.5 m long, its foot on the floor, its upper edge on the wall at y = 1.5 m."""
    board = box_mesh((-0.2, -0.02, 0.0), (0.2, 0.0, 1.5))
    board.apply_transform(trimesh.transformations.rotation_matrix(-TILT, [1, 0, 0]))
    board.apply_translation((-1.5, 1.5 - board.bounds[1][1] - 0.002, -board.bounds[0][2]))
    return board


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> ContactGraphFile:
    things = {
        1: ("floor", floor_mesh((-2, -2), (2, 1.5))),
        2: ("wall", box_mesh((-2, 1.5, 0), (2, 1.6, 2.4))),
        3: ("ceiling", floor_mesh((-2, -2), (2, 1.5), 2.4)),
        4: ("fridge", placed(open_cupboard(), (1.4, 1.0, 0.0))),
        5: ("bottle", placed(trimesh.creation.cylinder(radius=0.04, height=0.25), (1.4, 1.0, 0.745))),
        6: ("clock", box_mesh((0.0, 1.45, 1.6), (0.3, 1.498, 1.9))),
        7: ("lamp", box_mesh((-0.1, -0.1, 1.9), (0.1, 0.1, 2.395))),
        8: ("table", table_mesh((-0.6, -1.0), (0.6, 0.6, 0.7))),
        9: ("table", table_mesh((0.4, -1.0), (0.6, 0.6, 0.7))),
        10: ("box", box_mesh((-0.8, -1.15, 0.7), (0.5, -0.85, 0.73))),
        11: ("box", leaning_board()),
        12: ("chair", box_mesh((-0.8, -1.2, 0.0), (-0.4, -0.8, 0.5))),
    }
    folder = tmp_path_factory.mktemp("evidence")
    meshes = {k: mesh.subdivide_to_size(0.08) for k, (_, mesh) in things.items()}
    panoptic_map = write_map(folder / "map", meshes, {k: name for k, (name, _) in things.items()})
    (folder / "graph").mkdir()
    context = Context(output=folder / "graph", seed=0, device="cpu", progress=SilentProgress())
    return run(panoptic_map, parameters=GraphParameters(), context=context).info


def link(graph: ContactGraphFile, relation: str, source: str, target: str) -> Relation:
    return next(e for e in graph.links if (e.relation, e.source, e.target) == (relation, source, target))


def plane_normal(graph: ContactGraphFile, edge: Relation) -> np.ndarray:
    assert edge.plane is not None
    return np.array(graph.node(edge.source).planes[edge.plane].normal)


def test_contained(graph):
    edge = link(graph, "contains", "fridge_4", "bottle_5")
    assert graph.node("fridge_4").planes[edge.plane].center[2] == pytest.approx(0.62, abs=0.005)
    assert edge.inside == pytest.approx(1.0) and edge.overlap > 0.95 and abs(edge.gap) < 0.01
    assert edge.contact == pytest.approx((1.4, 1.0, 0.62), abs=0.01)


def test_on_a_wall(graph):
    edge = link(graph, "carries_on_wall", "wall_2", "clock_6")
    assert plane_normal(graph, edge) == pytest.approx([0, -1, 0], abs=0.01)
    assert edge.gap < 0.01 and edge.overlap == pytest.approx(1.0)
    assert edge.contact == pytest.approx((0.15, 1.5, 1.75), abs=0.01)


def test_from_the_ceiling(graph):
    edge = link(graph, "hangs_from", "ceiling_3", "lamp_7")
    assert abs(plane_normal(graph, edge)[2]) > 0.99
    assert edge.gap == pytest.approx(0.005, abs=0.003) and edge.overlap == pytest.approx(1.0)
    assert edge.contact == pytest.approx((0.0, 0.0, 2.4), abs=0.01)


def test_over_two_tables(graph):
    """The board reaches from -0.8 to 0.5: 0.5 m over the one table, 0.4 m over the other."""
    first = link(graph, "supports", "table_8", "box_10")
    second = link(graph, "also_supports", "table_9", "box_10")
    assert first.overlap == pytest.approx(0.5 / 1.3, abs=0.02) and second.overlap == pytest.approx(0.4 / 1.3, abs=0.02)
    assert first.contact == pytest.approx((-0.55, -1.0, 0.7), abs=0.02)
    assert second.contact == pytest.approx((0.3, -1.0, 0.7), abs=0.02)
    assert plane_normal(graph, second)[2] == pytest.approx(1.0)


def test_leaning(graph):
    edge = link(graph, "leans_on", "wall_2", "box_11")
    assert plane_normal(graph, edge) == pytest.approx([0, -1, 0], abs=0.01)
    top = 1.5 * np.cos(TILT)
    assert edge.contact[1] == pytest.approx(1.5, abs=0.01) and edge.contact[2] == pytest.approx(top, abs=0.08)
    assert edge.overlap == pytest.approx(edge.contact[2] / graph.node("box_11").box.size[2], abs=0.05)


def test_near_each_other(graph):
    """The chair is pushed under the table: all of its footprint, its upper 0.2 m of 0.5 m outside of nothing."""
    edge = next(e for e in graph.links if e.relation == "proximal" and {e.source, e.target} == {"table_8", "chair_12"})
    assert edge.overlap == edge.confidence == pytest.approx(1.0, abs=0.05)
    assert edge.contact == pytest.approx((-0.6, -1.0, 0.25), abs=0.02)
    # Its corners stand 3.5 to 8.5 cm inside of the table's legs.
    assert 0.0 < edge.gap < 0.1


def test_every_relation_that_was_seen_says_where(graph):
    for edge in graph.links:
        if edge.source != "scene":
            assert None not in (edge.gap, edge.overlap, edge.contact), edge


def test_middle_of_a_polygon_and_shares_of_boxes():
    triangle = np.array([[1.0, 1.0], [4.0, 1.0], [1.0, 4.0]])
    assert polygon_middle(triangle) == pytest.approx([2.0, 2.0])
    assert polygon_middle(triangle[:2]) is None
    outer, half_out = box_from_bounds((0, 0, 0), (1, 1, 1)), box_from_bounds((0.5, 0.2, 0.2), (1.5, 0.4, 0.4))
    assert share_inside(half_out, outer) == pytest.approx(0.5)
    assert shared_middle(half_out, outer) == pytest.approx((0.75, 0.3, 0.3))
    assert shared_middle(outer, box_from_bounds((2, 2, 2), (3, 3, 3))) is None


@pytest.mark.parametrize("meet", [None, 0, 1, EVERY - 1])
def test_the_least_distance_of_points_is_that_of_all_pairs(meet):
    random = np.random.default_rng(5)
    few, many = random.normal(size=(3 * EVERY, 3)), random.normal(size=(5 * EVERY, 3)) + (4.0, 0.0, 0.0)
    if meet is not None:
        many[7] = few[meet]
    first, second = (SimpleNamespace(name=name, points=points) for name, points in (("a", few), ("b", many)))
    expected = np.linalg.norm(few[:, None] - many[None], axis=2).min()
    assert Surfaces().distance(first, second) == pytest.approx(expected, abs=1e-12)
    assert (expected == 0.0) == (meet is not None)

"""What section 2.6.5 of the thesis leaves out: two carriers, leaning, hanging from the ceiling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.graph.balance import footing, overhang
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.panoptic_maps import box_mesh, chair_mesh, floor_mesh, placed, table_mesh, write_map

FLOOR = ("floor", floor_mesh((-2, -2), (2, 2)))
WALL = ("wall", box_mesh((-2, 1.5, 0), (2, 1.6, 2.4)))
CEILING = ("ceiling", floor_mesh((-2, -2), (2, 2), 2.4))


def graph_of(folder: Path, things: dict[int, tuple[str, trimesh.Trimesh]], method: str = "ours") -> ContactGraphFile:
    fine = {k: mesh.subdivide_to_size(0.05) for k, (_, mesh) in things.items()}
    panoptic_map = write_map(folder / "map", fine, {k: name for k, (name, _) in things.items()})
    output = folder / method
    output.mkdir()
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    return run(panoptic_map, parameters=GraphParameters(method=method), context=context).info


def edges(graph: ContactGraphFile, target: str) -> set[tuple[str, str]]:
    return {
        (link.source, link.relation) for link in graph.links if link.target == target and link.relation != "proximal"
    }


def leaning_board(foot: float, angle: float = 0.3) -> trimesh.Trimesh:
    """A board 1.5 m long and 3 cm thick whose lower edge stands at y = foot, leaning towards +y by `angle` [rad]."""
    board = box_mesh((-0.3, -0.03, 0.0), (0.3, 0.0, 1.5))
    board.apply_transform(trimesh.transformations.rotation_matrix(-angle, [1, 0, 0]))
    board.apply_translation([0, foot, -board.bounds[0][2]])
    return board


def test_a_board_over_two_tables(tmp_path: Path) -> None:
    things = {
        1: FLOOR,
        3: ("table", table_mesh((-0.6, 0.0), (0.6, 0.6, 0.7))),
        4: ("table", table_mesh((0.6, 0.0), (0.7, 0.6, 0.7))),
        5: ("box", box_mesh((-0.75, -0.15, 0.7), (0.75, 0.15, 0.8))),
    }
    graph = graph_of(tmp_path, things)
    assert edges(graph, "box_5") == {("table_4", "supports"), ("table_3", "also_supports")}
    second = next(link for link in graph.links if link.relation == "also_supports")
    assert second.overlap == pytest.approx(0.3, abs=0.05) and abs(second.gap) < 0.02
    assert graph.node("table_3").planes[second.plane].horizontal
    assert graph.parent_link("box_5").source == "table_4", "one parent, so that the tree stays one"


def test_two_desks_side_by_side_carry_what_stands_over_the_gap(tmp_path: Path) -> None:
    things = {
        1: FLOOR,
        3: ("desk", table_mesh((-0.51, 0.0), (1.0, 0.6, 0.7))),
        4: ("desk", table_mesh((0.51, 0.0), (1.0, 0.6, 0.7))),
        5: ("box", box_mesh((-0.3, -0.15, 0.7), (0.1, 0.15, 0.9))),
        6: ("cup", box_mesh((0.5, -0.04, 0.7), (0.58, 0.04, 0.8))),
    }
    graph = graph_of(tmp_path, things)
    assert edges(graph, "box_5") == {("desk_3", "supports"), ("desk_4", "also_supports")}
    assert edges(graph, "cup_6") == {("desk_4", "supports")}


def test_a_board_that_leans_on_the_wall(tmp_path: Path) -> None:
    top = 1.5 * np.sin(0.3)
    things = {1: FLOOR, 2: WALL, 5: ("box", leaning_board(1.5 - top))}
    graph = graph_of(tmp_path, things)
    assert edges(graph, "box_5") == {("floor_1", "supports"), ("wall_2", "leans_on")}
    leaning = next(link for link in graph.links if link.relation == "leans_on")
    assert leaning.gap is not None and leaning.gap < 0.03 and leaning.confidence >= 0.5


def test_what_stands_leans_on_nothing(tmp_path: Path) -> None:
    things = {
        1: FLOOR,
        2: WALL,
        3: ("table", table_mesh((0.9, 1.1), (0.9, 0.7, 0.7))),
        4: ("chair", chair_mesh((-0.8, 1.27))),
        5: ("box", box_mesh((-0.3, 1.47, 0.0), (0.3, 1.5, 1.2))),
    }
    graph = graph_of(tmp_path, things)
    assert not [link for link in graph.links if link.relation in ("leans_on", "also_supports")]


def test_a_lamp_hangs_from_the_ceiling(tmp_path: Path) -> None:
    lamp = trimesh.util.concatenate(
        [
            placed(trimesh.creation.cylinder(radius=0.02, height=0.5), (0.5, 0.0, 2.14)),
            placed(trimesh.creation.cylinder(radius=0.15, height=0.2), (0.5, 0.0, 1.8)),
        ]
    )
    things = {1: FLOOR, 2: WALL, 3: CEILING, 4: ("table", table_mesh((0.5, 0.0))), 5: ("lamp", lamp)}
    graph = graph_of(tmp_path, things)
    assert edges(graph, "lamp_5") == {("ceiling_3", "hangs_from")}
    assert graph.parent_link("lamp_5").gap < 0.05


def test_the_thesis_rule_knows_none_of_it(tmp_path: Path) -> None:
    things = {1: FLOOR, 2: WALL, 5: ("box", leaning_board(1.5 - 1.5 * np.sin(0.3)))}
    graph = graph_of(tmp_path, things, "thesis")
    assert {link.relation for link in graph.links} <= {"supports", "contains", "carries_on_wall", "proximal"}


def test_overhang_in_closed_form() -> None:
    """A board of length L at angle a from upright: its middle lies L/2 sin a beside its lower edge."""
    along = np.linspace(0.0, 1.0, 201)
    points = np.array([[x, s * np.sin(0.4), s * np.cos(0.4)] for s in along for x in (0.0, 0.5)])
    reach = 0.03 + np.quantile(points[:, 2], 0.01)  # what counts as foot reaches a little up the board
    expected = 0.5 * np.sin(0.4) - reach * np.tan(0.4)
    assert overhang(points) == pytest.approx(expected, abs=0.004)
    upright = points[:, [0, 2, 1]] * [1.0, 0.0, 1.0] + [0.0, 0.1, 0.0]
    assert overhang(upright) == 0.0
    assert footing(points)[:, 1].max() < 0.02

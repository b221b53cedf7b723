"""What things without CAD model rest on, how heavy and how rough things of a class are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Box, Relation, SurfacePlane
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.formats.scene_links import INFERRED
from scenewright.stages.kit.formats.scene_supports import Carried, cut_below, levelled, standing_points
from scenewright.stages.kit.formats.urdf_check import check_urdf
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.geometry.solids import hull
from scenewright.stages.kit.geometry.substances import FRICTION_OF_LIKE, SUBSTANCES, substance_of
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.settle_report import settle_report

CUP = Carried(Box(center=(0.3, 0.0, 0.8), size=(0.1, 0.1, 0.1)), height=0.75)


@pytest.mark.parametrize(
    ("center", "top", "expected"),
    [
        (0.3, 0.77, 0.75),  # sticks out below the cup: cut
        (0.3, 0.80, 0.80),  # a wall, no unevenness: kept
        (-0.2, 0.77, 0.77),  # beside it: kept
        (0.3, 0.74, 0.74),
    ],
)
def test_boxes_end_at_the_plane_below_what_they_carry(center: float, top: float, expected: float) -> None:
    boxes = [(np.array([center, 0.0, 0.5 * top]), np.array([0.2, 0.2, top]))]
    turned = np.eye(4)
    [(middle, size)] = levelled(boxes, 0.0, turned, [CUP])
    assert middle[2] + 0.5 * size[2] == pytest.approx(expected)
    assert middle[2] - 0.5 * size[2] == pytest.approx(0.0)


def test_what_lies_above_the_plane_below_a_thing_is_left_out_wherever_the_body_is() -> None:
    """The body is turned by a right angle and lifted: its box at (0, -0.3) stands at (0.3, 0) of the world."""
    pose = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1.0]])
    boxes = [(np.array([0.0, -0.3, 0.265]), np.array([0.05, 0.05, 0.02]))]
    assert levelled(boxes, 0.0, pose, [CUP]) == []
    assert len(levelled(boxes, 0.0, np.eye(4), [CUP])) == 1


@pytest.mark.parametrize(("low", "kept"), [(0.752, 0), (0.70, 1)])
def test_a_lump_as_high_as_the_thing_on_the_plane_is_a_piece_of_it(low: float, kept: int) -> None:
    """What reaches through the plane is a wall, which goes on beside the thing."""
    boxes = [(np.array([0.36, 0.0, 0.5 * (low + 0.83)]), np.array([0.04, 0.04, 0.83 - low]))]
    assert len(levelled(boxes, 0.0, np.eye(4), [CUP])) == kept


def test_a_standing_hull_is_flat_where_it_rests() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    solid = hull(standing_points(ball.vertices, -0.12))
    bottom = solid.vertices[solid.vertices[:, 2] < -0.12 + 1e-9]
    assert solid.vertices[:, 2].min() == pytest.approx(-0.12)
    assert np.linalg.norm(bottom[:, :2], axis=1).max() == pytest.approx(0.1, abs=0.005)


def uneven_scene() -> tuple[list[BundleBody], ContactGraphFile]:
    """A bumpy table top without CAD model at 0.75 m, and a ball of which the lowest 3 cm were not seen."""
    random = np.random.default_rng(3)
    top = trimesh.creation.box((1.0, 0.6, 0.02)).subdivide().subdivide().subdivide().subdivide()
    top.vertices[:, 2] += random.uniform(0.0, 0.015, len(top.vertices))
    top.apply_translation([0, 0, 0.74])
    blob = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    blob.apply_translation([0.2, 0.1, 0.83])
    plane = SurfacePlane(normal=(0, 0, 1), offset=-0.75, area=0.6, center=(0, 0, 0.75), horizontal=True)
    boxes = {
        "floor_1": Box(center=(0, 0, -0.05), size=(3, 3, 0.1)),
        "table_2": Box(center=(0, 0, 0.375), size=(1.0, 0.6, 0.75)),
        "object_3": Box(center=(0.2, 0.1, 0.805), size=(0.1, 0.1, 0.11)),
    }
    bodies = []
    for name, mesh in (("floor_1", None), ("table_2", top), ("object_3", blob)):
        pose = np.eye(4)
        if mesh is not None:
            pose[:3, 3] = np.array(boxes[name].center) - [0, 0, 0.5 * boxes[name].size[2]]
            mesh.apply_translation(-pose[:3, 3])
        parent = {"floor_1": None, "table_2": "floor_1", "object_3": "table_2"}[name]
        class_name = name.split("_")[0]
        bodies.append(
            BundleBody(name, class_name, parent, "supports", pose, name == "object_3", boxes[name], mesh=mesh)
        )
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name="scene", node_type="scene")]
    nodes += [
        GraphNode(
            id=body.name,
            instance=k,
            class_name=body.class_name,
            node_type="layout" if k == 1 else "rigid",
            box=body.box,
            planes=(plane,) if body.name == "table_2" else (),
        )
        for k, body in enumerate(bodies, start=1)
    ]
    links = tuple(
        Relation(
            source=body.parent or SCENE_NODE,
            target=body.name,
            relation="supports",
            confidence=1.0,
            plane=0 if body.name == "object_3" else None,
        )
        for body in bodies
    )
    return bodies, ContactGraphFile(nodes=tuple(nodes), links=links)


def test_a_reconstructed_thing_stays_on_a_reconstructed_table(tmp_path: Path) -> None:
    bodies, graph = uneven_scene()
    write_scene_bundle(tmp_path / "with", bodies, graph)
    report = settle_report(tmp_path / "with", 1.0)
    assert report.settled and report.bodies[0].moved < 0.003
    assert not report.collisions
    bare = graph.model_copy(update={"links": tuple(link.model_copy(update={"plane": None}) for link in graph.links)})
    write_scene_bundle(tmp_path / "without", bodies, bare)
    assert not settle_report(tmp_path / "without", 1.0).settled  # which is why the plane is needed


@pytest.mark.parametrize("hidden", [False, True])
def test_a_top_that_nobody_saw_is_drawn_as_inferred(tmp_path: Path, hidden: bool) -> None:
    bodies, graph = uneven_scene()
    nodes = tuple(
        node.model_copy(update={"planes": tuple(p.model_copy(update={"hidden": hidden}) for p in node.planes)})
        for node in graph.nodes
    )
    write_scene_bundle(tmp_path, bodies, graph.model_copy(update={"nodes": nodes}))
    link = parse_urdf(tmp_path / "scene.urdf").link("table_2")
    drawn = [shape.box_size for shape in link.visuals if shape.color == pytest.approx(INFERRED)]
    assert drawn == ([pytest.approx((0.1, 0.1, 0.02))] if hidden else []), "the pad under the ball"


def test_mass_and_friction_follow_the_class(tmp_path: Path) -> None:
    bodies, graph = uneven_scene()
    write_scene_bundle(tmp_path, bodies, graph)
    path = tmp_path / "bodies/object_3.urdf"
    link = parse_urdf(path).link("object_3")
    lower, upper = 0.05**3 * np.pi * 4 / 3, 0.1 * 0.1 * 0.14
    assert link.inertial is not None
    assert lower < link.inertial.mass / substance_of("object").hull_density < upper
    assert link.friction == pytest.approx(0.35)
    with load_scene(tmp_path) as world:
        info = engine.getDynamicsInfo(world.bodies["object_3"].body_id, -1, physicsClientId=world.client)
        assert info[1] == pytest.approx(0.35**0.5)
    assert 'friction="0.35 0.005 0.0005"' in (tmp_path / "scene.mjcf.xml").read_text()


def test_negative_friction_is_found(tmp_path: Path) -> None:
    bodies, graph = uneven_scene()
    write_scene_bundle(tmp_path, bodies, graph)
    path = tmp_path / "bodies/object_3.urdf"
    text = path.read_text()
    assert check_urdf(path, tmp_path) == []
    path.write_text(text.replace('lateral_friction value="0.', 'lateral_friction value="-0.'))
    assert [problem.kind for problem in check_urdf(path, tmp_path)] == ["friction"]


def test_every_class_is_made_of_something() -> None:
    assert {entry.name for entry in load_vocabulary().classes} <= set(SUBSTANCES) | {"void"}
    assert {substance.surface for substance in SUBSTANCES.values()} <= set(FRICTION_OF_LIKE)


def test_a_spike_over_a_plane_is_no_piece() -> None:
    """One corner that rises beside what stands there spans nothing."""
    box = trimesh.creation.box(bounds=[[-0.5, -0.5, 0.0], [0.5, 0.5, 0.77]])
    spiked = np.vstack([box.vertices, [[-0.45, 0.45, 0.9]]])
    [piece] = cut_below([spiked], np.eye(4), [CUP])
    assert len(piece) == len(spiked) and piece[:, 2].max() == pytest.approx(CUP.height)


def test_a_thing_keeps_its_shape_where_all_of_it_lies_in_what_it_carries() -> None:
    low, high = [-0.01, -0.01, CUP.height + 0.001], [0.01, 0.01, CUP.height + 0.01]
    piece = np.array(trimesh.creation.box(bounds=[low, high]).vertices)
    assert [kept.tolist() for kept in cut_below([piece], np.eye(4), [CUP])] == [piece.tolist()]

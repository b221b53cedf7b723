"""Lamps by their shades: surfaces of revolution of which all is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import Relation, SurfacePlane
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.carcasses import patches_of
from scenewright.stages.cad.families import lamps
from scenewright.stages.cad.families.fitting import Fitted, fit
from scenewright.stages.cad.families.forms import Form, Reading
from scenewright.stages.cad.made_models import FAMILY
from scenewright.stages.cad.recognition import with_carriers
from scenewright.stages.cad.target import Surroundings
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scipy.spatial import cKDTree

from tests.panoptic_maps import placed, seen_surface
from tests.unit.cad.test_families import EYES, Known

AT = (0.3, -0.2, 0.0)
SHADE = [(0.18, 0.9), (0.13, 1.18)]
"""Radius and height of its rims [m]."""
POLE = [(0.02, 0.03), (0.02, 0.9)]
FOOT = [(0.0, 0.03), (0.14, 0.03), (0.14, 0.0)]


def reading_of(*profiles: list[tuple[float, float]], class_name: str = "lamp", filled: bool = False) -> Reading:
    """What cameras all around see of surfaces of revolution by radius and height, on the ground, to 4 cm of which they
    see that nothing is there; `filled`: nobody saw that anything is empty."""
    shown = trimesh.util.concatenate([trimesh.creation.revolve(np.array(line), sections=48) for line in profiles])
    mesh = seen_surface({1: placed(shown, AT)}, EYES, noise=0.002)[1]
    entity = EntityMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), np.zeros((len(mesh.vertices), 3), np.uint8))
    unknown = [((-9.0, -9.0, -9.0), (9.0, 9.0, 9.0 if filled else 0.01))]  # and what is 3 cm from it
    own = cKDTree(entity.vertices)
    return Reading(patches_of(entity), 0.0, np.eye(3), Known(unknown, np.eye(4)), own, class_name=class_name)


def form_of(reading: Reading) -> Form:
    form = lamps.read(reading)
    assert isinstance(form, Form), form
    return form


def test_a_shade_alone_gets_a_pole_and_a_foot_on_which_it_stands() -> None:
    form = form_of(reading_of(SHADE))
    assert form.words == "shade; inferred: pole, foot" and form.classes == ("lamp",)
    shade, pole, foot = form.pieces
    for piece in (shade, pole, foot):
        np.testing.assert_allclose(piece.corners.mean(axis=0)[:2], AT[:2], atol=0.01)
    np.testing.assert_allclose([shade.corners[:, 2].min(), shade.corners[:, 2].max()], [0.9, 1.18], atol=0.02)
    widths = [np.ptp(shade.corners[rows, 0]) / 2 for rows in (slice(0, 16), slice(16, 32))]
    np.testing.assert_allclose(widths, [0.18, 0.13], atol=0.01)
    assert pole.corners[:, 2].min() == foot.corners[:, 2].min() == 0.0
    assert isinstance(fit("lamp", reading_of(SHADE)), Fitted)


def test_what_is_seen_of_pole_and_foot_is_as_it_was_seen() -> None:
    form = form_of(reading_of(SHADE, POLE, FOOT, class_name="object", filled=True))
    assert form.words == "shade, pole, foot"
    _, pole, foot = form.pieces
    assert np.ptp(pole.corners[:, 0]) / 2 == pytest.approx(0.02, abs=0.006)
    assert np.ptp(foot.corners[:, 0]) / 2 == pytest.approx(0.13, abs=0.02)


@pytest.mark.parametrize(
    ("reading", "why"),
    [
        (lambda: reading_of(SHADE, class_name="object"), "nobody saw a pole"),
        (lambda: reading_of([(0.18, 0.0), (0.18, 0.3)]), "not over a pole"),
        (lambda: replace(reading_of(SHADE), base=-1.2), "would hang"),
        (lambda: reading_of([(0.18, 0.9), (0.18, 0.91)]), "no shade"),
        (lambda: reading_of(SHADE, [(0.1, 0.0), (0.1, 0.7)]), "no pole"),
    ],
)
def test_what_is_no_lamp_says_why(reading, why: str) -> None:
    told = lamps.read(reading())
    assert isinstance(told, str) and why in told, told


def test_a_square_is_not_round() -> None:
    box = trimesh.creation.box(bounds=((-0.18, -0.18, 0.9), (0.18, 0.18, 1.18)))
    mesh = seen_surface({1: placed(box, AT, 0.4)}, EYES, noise=0.002)[1]
    entity = EntityMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), np.zeros((len(mesh.vertices), 3), np.uint8))
    own = cKDTree(entity.vertices)
    reading = Reading(patches_of(entity), 0.0, np.eye(3), Known([], np.eye(4)), own, class_name="lamp")
    assert lamps.read(reading) == "it is not round"


def test_the_axis_is_where_normals_meet() -> None:
    reading = reading_of([(0.18, 0.0), (0.18, 0.3)])
    sides = reading.patches.chosen(np.abs(reading.patches.normals[:, 2]) < 0.5)
    seen_from_one_side = sides.chosen(sides.points[:, 1] < AT[1])
    for patches in (sides, seen_from_one_side):
        found = lamps.axis_of(patches)
        assert found is not None
        np.testing.assert_allclose(found[0], AT[:2], atol=0.01)
        assert found[1] == pytest.approx(0.18, abs=0.015)
    assert lamps.axis_of(sides.chosen(np.arange(3))) is None


def plane(height: float, half: float, *, horizontal: bool = True) -> SurfacePlane:
    ring = [(-half, -half, height), (half, -half, height), (half, half, height), (-half, half, height)]
    return SurfacePlane(
        normal=(0, 0, 1), offset=-height, area=4 * half**2, center=(0, 0, height), corners=ring, horizontal=horizontal
    )


def graph_of(relation: str) -> ContactGraphFile:
    box = box_from_bounds((-0.1, -0.1, 1.2), (0.1, 0.1, 1.5))
    nodes = [
        GraphNode(id="scene", instance=0, class_name="scene", node_type="scene"),
        GraphNode(id="floor_1", instance=1, class_name="floor", node_type="layout", planes=(plane(0.0, 2.0),)),
        GraphNode(
            id="desk_2",
            instance=2,
            class_name="desk",
            node_type="rigid",
            planes=(plane(0.9, 0.3, horizontal=False), plane(0.75, 0.3), plane(1.3, 0.3)),
        ),
        GraphNode(id="lamp_3", instance=3, class_name="lamp", node_type="rigid", box=box, planes=(plane(1.1, 0.3),)),
    ]
    links = [
        Relation(source="scene", target="floor_1", relation="supports", confidence=1.0),
        Relation(source="floor_1", target="desk_2", relation="supports", confidence=1.0, plane=0),
        Relation(source="scene", target="lamp_3", relation=relation, confidence=0.0),
    ]
    return ContactGraphFile(nodes=nodes, links=links)


def around(relation: str) -> Surroundings:
    graph = graph_of(relation)
    return Surroundings(graph.node("lamp_3"), graph, Known([], np.eye(4)))


def test_what_floats_reaches_down_to_the_nearest_level_surface_below_it() -> None:
    floating, standing = around("unknown"), around("supports")
    below = floating.surface_below
    assert below is not None and (below.source, below.target, below.plane) == ("desk_2", "lamp_3", 1)
    assert below.gap == pytest.approx(0.45) and floating.stands_at == pytest.approx(0.75)
    assert not standing.floats and standing.surface_below is None and standing.stands_at == pytest.approx(1.2)


def test_what_its_parts_reach_down_to_carries_it_if_they_are_chosen() -> None:
    graph, below = graph_of("unknown"), around("unknown").surface_below
    shortlists = {"lamp_3": Shortlist(graph.node("lamp_3"), (), {}, "", carrier=below)}
    for recipe, source in (({FAMILY: "lamp"}, "desk_2"), ({}, "scene")):
        chosen = {"lamp_3": SimpleNamespace(shape=SimpleNamespace(model=SimpleNamespace(recipe=recipe)))}
        link = with_carriers(graph, shortlists, chosen).parent_link("lamp_3")
        assert link is not None and link.source == source
    assert with_carriers(graph, shortlists, {}) == graph

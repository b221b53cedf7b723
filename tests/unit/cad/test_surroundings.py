"""What was mapped without a name stays in the scene, but for the rims of what has one."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.stages.cad.surroundings import convex_of, footing, nameless_surface, near_any
from scenewright.stages.kit.formats.entity_meshes import EntityMesh

LIMITS = {"clearance": 0.03, "smallest_area": 0.02, "tolerance": 0.002}


def piece(low, high):
    box = trimesh.creation.box(bounds=[low, high])
    return np.asarray(box.vertices), np.asarray(box.faces)


def mapped(*boxes):
    """A map's mesh of boxes (low, high), cut into triangles of at most 4 cm, and the box of each vertex."""
    vertices, faces, numbers, count = [], [], [], 0
    for number, (low, high) in enumerate(boxes):
        box = trimesh.creation.box(bounds=[low, high])
        fine, triangles = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, 0.04)
        vertices.append(fine)
        faces.append(triangles + count)
        numbers.append(np.full(len(fine), number))
        count += len(fine)
    points = np.concatenate(vertices)
    return EntityMesh(points, np.concatenate(faces), np.full((len(points), 3), 90, np.uint8)), np.concatenate(numbers)


def test_near_any_is_the_distance_to_faces():
    random = np.random.default_rng(0)
    low, high = np.array([-0.3, -0.2, 0.0]), np.array([0.3, 0.2, 0.5])
    points = random.uniform(-1, 1, (2000, 3))
    outside = np.maximum(low - points, points - high).max(axis=1)
    assert np.array_equal(near_any(points, [convex_of(piece(low, high)[0])], 0.05), outside < 0.05)
    assert not near_any(points, [], 0.05).any()
    flat = convex_of(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]))
    assert near_any(np.array([[0.5, 0.5, 0.04], [0.5, 0.5, 0.06]]), [flat], 0.05).tolist() == [True, False]


def test_a_counter_stays_and_what_has_a_name_does_not():
    counter, chair = ((0.0, 0.0, 0.0), (1.5, 0.6, 0.9)), ((3.0, 0.0, 0.0), (3.5, 0.5, 0.9))
    mesh, number = mapped(counter, chair)
    found = nameless_surface(mesh, number, [piece(*chair)], **LIMITS)
    assert found is not None
    assert found.vertices.min(axis=0) == pytest.approx(counter[0]) and found.vertices.max(axis=0) == pytest.approx(
        counter[1]
    )
    assert nameless_surface(mesh, np.ones(len(number), int), [piece(*chair)], **LIMITS) is None, "everything has a name"


def test_rims_and_specks_are_left_out():
    chair, speck = ((3.0, 0.0, 0.0), (3.5, 0.5, 0.9)), ((0.0, 0.0, 1.0), (0.04, 0.04, 1.04))
    rim = ((2.98, -0.02, -0.02), (3.52, 0.52, 0.92))
    mesh, _ = mapped(rim, speck)
    assert nameless_surface(mesh, np.zeros(len(mesh.vertices), int), [piece(*chair)], **LIMITS) is None


def test_the_boxes_of_what_is_left_stand_in_nothing():
    """A cupboard without a name around a fridge with one: its boxes would reach into the fridge."""
    cupboard, fridge = ((0.0, 0.0, 0.0), (2.0, 0.6, 2.0)), ((0.5, 0.1, 0.0), (1.1, 0.9, 1.8))
    mesh, number = mapped(cupboard)
    found = nameless_surface(mesh, number, [piece(*fridge)], **LIMITS)
    assert found is not None
    inside = np.all((found.vertices > np.array(fridge[0])) & (found.vertices < np.array(fridge[1])), axis=1)
    assert not inside.any() and len(found.faces) > 0.5 * len(mesh.faces)


def test_footing_is_under_a_thing():
    vertices, _ = footing([piece((0, 0, 0.7), (0.2, 0.3, 0.9))])
    assert vertices.min(axis=0) == pytest.approx([0, 0, 0.65]) and vertices.max(axis=0) == pytest.approx(
        [0.2, 0.3, 0.7]
    )

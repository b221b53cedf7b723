"""The nearest triangle by a tree: against every triangle one by one, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.cad.nearest_triangles import LEAF, forest_of, nearest_triangles, tree_of

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def test_a_square_by_closed_form() -> None:
    points = np.array([[0.5, 0.25, 2.0], [3.0, 0.5, 0.0], [2.0, 2.0, 1.0], [-1.0, -1.0, -1.0]])
    found = nearest_triangles(tree_of(SQUARE, HALVES, np.array([7, 9])), points)
    assert found.distance == pytest.approx([2.0, 2.0, np.sqrt(3), np.sqrt(3)])
    assert found.points == pytest.approx(np.array([[0.5, 0.25, 0], [1, 0.5, 0], [1, 1, 0], [0, 0, 0]]))
    assert np.all(found.normals == [0, 0, 1]) and found.numbers[0] == 7


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 12 * LEAF))
def test_as_near_as_trimesh_finds(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    vertices, faces = random.normal(size=(3 * count, 3)), np.arange(3 * count).reshape(-1, 3)
    points = random.normal(size=(40, 3)) * 2
    found = nearest_triangles(tree_of(vertices, faces), points)
    every = np.stack(
        [trimesh.triangles.closest_point(np.repeat(vertices[face][None], len(points), 0), points) for face in faces]
    )
    gaps = np.linalg.norm(every - points, axis=2)
    assert found.distance == pytest.approx(gaps.min(axis=0), abs=1e-9)
    assert found.numbers.tolist() == gaps.argmin(axis=0).tolist()
    assert np.linalg.norm(found.points - points, axis=1) == pytest.approx(found.distance, abs=1e-9)


def test_triangles_without_area_are_edges_and_points() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]])
    for faces, gap in (([[0, 1, 2]], 2.0), ([[0, 0, 0]], 3.0), ([[0, 1, 3]], 1.0), ([[3, 0, 0]], 1.0)):
        found = nearest_triangles(tree_of(vertices, np.array(faces)), np.array([[3.0, 0, 0]]))
        assert found.distance == pytest.approx([gap]) and np.all(found.normals == 0)


def test_trees_of_a_forest_answer_each_for_itself() -> None:
    box = trimesh.creation.icosphere(2)
    trees = [tree_of(SQUARE, HALVES), tree_of(box.vertices + [5, 0, 0], box.faces), tree_of(SQUARE + [0, 0, 3], HALVES)]
    forest, roots = forest_of(trees)
    points = np.random.default_rng(0).normal(size=(50, 3)) * 3
    for tree, root in zip(trees, roots, strict=True):
        alone, together = nearest_triangles(tree, points), nearest_triangles(forest, points, root)
        assert all(np.array_equal(first, second) for first, second in zip(alone, together, strict=True))


def test_nothing_is_infinitely_far() -> None:
    empty = nearest_triangles(tree_of(SQUARE, np.zeros((0, 3), int)), SQUARE)
    assert np.isinf(empty.distance).all()
    assert len(nearest_triangles(tree_of(SQUARE, HALVES), np.zeros((0, 3))).distance) == 0


def test_many_equal_triangles_do_not_deepen_the_tree() -> None:
    faces = np.repeat(HALVES, 500, axis=0)
    assert nearest_triangles(tree_of(SQUARE, faces), np.array([[0.5, 0.2, 1.0]])).distance == pytest.approx([1.0])

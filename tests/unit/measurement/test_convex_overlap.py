"""Depth and volume that convex pieces share, against closed forms and a second implementation."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.measurement.convex_overlap import (
    convex_piece,
    penetration_depth,
    piece_depth,
    shared_volume,
)
from scipy.spatial import ConvexHull, HalfspaceIntersection
from scipy.spatial.transform import Rotation

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def cuboid(low, high):
    return convex_piece(np.array(low) + CORNERS * (np.array(high, dtype=float) - low))


def test_a_box_has_six_faces_and_three_directions_of_edges():
    piece = cuboid((0, 0, 0), (1, 2, 3))
    assert len(piece.normals) == 6 and len(piece.edges) == 3 and len(piece.vertices) == 8


def test_boxes_that_overlap_in_a_corner():
    a, b = cuboid((0, 0, 0), (1, 1, 1)), cuboid((0.9, 0.7, 0.8), (2, 2, 2))
    assert piece_depth(a, b) == pytest.approx(0.1)
    assert shared_volume([a], [b]) == pytest.approx(0.1 * 0.3 * 0.2)


def test_touching_and_separate_boxes_share_nothing():
    a = cuboid((0, 0, 0), (1, 1, 1))
    assert piece_depth(a, cuboid((1, 0, 0), (2, 1, 1))) == pytest.approx(0.0, abs=1e-12)
    assert penetration_depth([a], [cuboid((0.2, 0.2, 1.5), (0.4, 0.4, 2))]) == 0.0
    assert shared_volume([a], [cuboid((3, 0, 0), (4, 1, 1))]) == 0.0


def test_a_box_inside_another_has_to_leave_by_the_nearest_face():
    outer, inner = cuboid((0, 0, 0), (2, 2, 2)), cuboid((0.5, 0.9, 0.9), (0.7, 1.1, 1.1))
    assert piece_depth(outer, inner) == pytest.approx(0.7)
    assert shared_volume([outer], [inner]) == pytest.approx(0.2**3)


def test_crossed_edges_need_the_cross_product():
    """Two roofs, ridge over ridge at right angles: the shortest way is straight up, along no face's normal."""
    lower = convex_piece(np.array([[-1, -1, -1], [1, -1, -1], [-1, 1, -1], [1, 1, -1], [-1, 0, 0], [1, 0, 0]], float))
    upper = convex_piece(
        np.array([[-1, -1, 1], [1, -1, 1], [-1, 1, 1], [1, 1, 1], [0, -1, 0], [0, 1, 0]], float) - [0, 0, 0.1]
    )
    assert piece_depth(lower, upper) == pytest.approx(0.1)


def test_pieces_that_share_space_with_two_are_counted_once():
    bar = cuboid((0, 0, 0), (1, 0.1, 0.1))
    halves = [cuboid((0, 0, 0), (0.6, 0.1, 0.1)), cuboid((0.4, 0, 0), (1, 0.1, 0.1))]
    assert shared_volume([bar], halves) == pytest.approx(0.01)


def test_random_polytopes_against_halfspace_intersection():
    random = np.random.default_rng(3)
    compared = 0
    for _ in range(6):
        a = convex_piece(random.normal(size=(14, 3)) * 0.1)
        turn = transform_from(Rotation.random(random_state=random).as_matrix(), random.normal(size=3) * 0.05)
        b = convex_piece(random.normal(size=(14, 3)) * 0.1).placed(turn, 1.2)
        depth = piece_depth(a, b)
        assert depth == pytest.approx(piece_depth(b, a))
        if depth < 0.02:
            continue
        compared += 1
        planes = np.column_stack([np.concatenate([a.normals, b.normals]), -np.concatenate([a.offsets, b.offsets])])
        inside = random.uniform(np.maximum(a.low, b.low), np.minimum(a.high, b.high), size=(4000, 3))
        inner = inside[np.argmin((inside @ planes[:, :3].T + planes[:, 3]).max(axis=1))]
        volume = ConvexHull(HalfspaceIntersection(planes, inner).intersections).volume
        assert shared_volume([a], [b]) == pytest.approx(volume, rel=0.02)
        # Moved apart by a little more than its depth along the best of many directions, they no longer meet.
        directions = random.normal(size=(4000, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        ways = (a.vertices @ directions.T).max(axis=0) - (b.vertices @ directions.T).min(axis=0)
        assert depth <= ways.min() + 1e-9 and depth == pytest.approx(ways.min(), rel=0.1)
    assert compared >= 3


def test_flat_points_are_no_piece():
    assert convex_piece(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float)) is None
    assert convex_piece(np.zeros((2, 3))) is None

"""Boxes against closed forms and against shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.kit.geometry import boxes

lengths = st.floats(0.05, 3.0)
positions = st.floats(-2.0, 2.0)
yaws = st.floats(-math.pi, math.pi)
box_strategy = st.builds(
    lambda x, y, z, a, b, c, yaw: boxes.gravity_aligned_box((x, y, z), (a, b, c), yaw),
    positions,
    positions,
    positions,
    lengths,
    lengths,
    lengths,
    yaws,
)


@given(box_strategy)
@settings(max_examples=60, deadline=None)
def test_minimum_box_of_corners_is_the_box(box):
    found = boxes.minimum_box(boxes.box_corners(box))
    assert boxes.box_iou(found, box) > 1 - 1e-6
    assert -math.pi / 4 <= boxes.box_yaw(found) < math.pi / 4


@given(st.integers(0, 2**31), st.integers(4, 40))
@settings(max_examples=40, deadline=None)
def test_minimum_rectangle_matches_shapely(seed, count):
    points = np.random.default_rng(seed).normal(size=(count, 2)) * [2.0, 0.7]
    _, size, _ = boxes.minimum_rectangle(points)
    reference = shapely.MultiPoint(points).minimum_rotated_rectangle.area
    assert size[0] * size[1] == pytest.approx(reference, rel=1e-6)


@given(st.integers(0, 2**31))
@settings(max_examples=30, deadline=None)
def test_minimum_box_contains_all_points_and_touches_them(seed):
    points = np.random.default_rng(seed).uniform(-1, 1, size=(30, 3))
    box = boxes.minimum_box(points)
    assert boxes.points_in_box(box, points, margin=1e-9).all()
    local = boxes.transform_points_to_box(box, points)
    assert np.allclose(local.max(axis=0), np.array(box.size) / 2, atol=1e-9)
    assert np.allclose(local.min(axis=0), -np.array(box.size) / 2, atol=1e-9)


@given(box_strategy, box_strategy)
@settings(max_examples=100, deadline=None)
def test_iou_matches_shapely(a, b):
    def prism(box):
        ground = shapely.box(-box.size[0] / 2, -box.size[1] / 2, box.size[0] / 2, box.size[1] / 2)
        ground = shapely.affinity.rotate(ground, boxes.box_yaw(box), origin=(0, 0), use_radians=True)
        return shapely.affinity.translate(ground, *box.center[:2])

    height = max(0.0, min(boxes.top(a), boxes.top(b)) - max(boxes.bottom(a), boxes.bottom(b)))
    shared = prism(a).intersection(prism(b)).area * height
    expected = shared / (boxes.box_volume(a) + boxes.box_volume(b) - shared)
    assert boxes.boxes_overlap_volume(a, b) == pytest.approx(shared, abs=1e-9)
    assert boxes.box_iou(a, b) == pytest.approx(expected, abs=1e-9)
    assert boxes.box_iou(a, b) == pytest.approx(boxes.box_iou(b, a), abs=1e-9)


def test_iou_closed_forms():
    a = boxes.box_from_bounds(np.zeros(3), np.ones(3))
    b = boxes.box_from_bounds(np.array([0.5, 0, 0]), np.array([1.5, 1, 1]))
    assert boxes.box_iou(a, a) == pytest.approx(1.0)
    assert boxes.box_iou(a, b) == pytest.approx(1 / 3)
    # A unit square turned by 45 degrees about the same centre shares a regular octagon.
    c = boxes.gravity_aligned_box((0.5, 0.5, 0.5), (1, 1, 1), math.pi / 4)
    octagon = 2 * (math.sqrt(2) - 1)
    assert boxes.boxes_overlap_volume(a, c) == pytest.approx(octagon)
    d = boxes.box_from_bounds(np.array([5.0, 5, 5]), np.array([6.0, 6, 6]))
    assert boxes.box_iou(a, d) == 0.0


def test_corners_footprint_and_yaw():
    box = boxes.gravity_aligned_box((1, 2, 3), (2, 4, 6), math.pi / 2)
    corners = boxes.box_corners(box)
    assert np.allclose(corners.min(axis=0), [-1, 1, 0]) and np.allclose(corners.max(axis=0), [3, 3, 6])
    assert boxes.polygon_area(boxes.footprint(box)) == pytest.approx(8.0)
    assert boxes.box_yaw(box) == pytest.approx(math.pi / 2)
    leaning = box.model_copy(update={"orientation": (math.sin(0.1), 0.0, 0.0, math.cos(0.1))})
    with pytest.raises(ValueError, match="gravity"):
        boxes.box_yaw(leaning)


@pytest.mark.parametrize(
    "points",
    [
        np.array([[1.0, 2.0, 3.0]]),
        np.array([[0.0, 0, 0], [1.0, 1, 0]]),
        np.stack([np.linspace(0, 1, 9), 2 * np.linspace(0, 1, 9), np.zeros(9)], axis=1),
        np.zeros((5, 3)),
    ],
)
def test_degenerate_points_still_give_a_tight_box(points):
    box = boxes.minimum_box(points)
    assert boxes.points_in_box(box, points, margin=1e-9).all()
    assert boxes.box_volume(box) == pytest.approx(0.0, abs=1e-9)
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    assert np.linalg.norm(box.size) == pytest.approx(diagonal, abs=1e-9)


def test_minimum_box_refuses_nothing_and_nan():
    with pytest.raises(ValueError, match="no points"):
        boxes.minimum_box(np.zeros((0, 3)))
    with pytest.raises(ValueError, match="finite"):
        boxes.minimum_box(np.array([[np.nan, 0, 0]]))
    with pytest.raises(ValueError, match="exceeds"):
        boxes.box_from_bounds(np.ones(3), np.zeros(3))


def test_with_extent_keeps_the_footprint():
    box = boxes.gravity_aligned_box((0, 0, 1), (1, 2, 0.5), 0.3)
    longer = boxes.with_extent(box, 0.0, boxes.top(box))
    assert boxes.bottom(longer) == pytest.approx(0) and boxes.top(longer) == pytest.approx(1.25)
    assert np.allclose(boxes.footprint(longer), boxes.footprint(box))


@given(st.integers(0, 1000), yaws)
@settings(max_examples=30, deadline=None)
def test_box_at_a_yaw_touches_all_its_points(seed, yaw):
    points = np.random.default_rng(seed).normal(size=(20, 3))
    box = boxes.box_at_yaw(points, yaw)
    assert boxes.box_yaw(box) == pytest.approx(yaw)
    inside = boxes.transform_points_to_box(box, points)
    assert inside.max(axis=0) == pytest.approx(np.array(box.size) / 2)
    assert inside.min(axis=0) == pytest.approx(-np.array(box.size) / 2)


def test_turned_box_keeps_centre_and_size():
    box = boxes.gravity_aligned_box((1, 2, 3), (0.1, 0.2, 0.3), 0.4)
    turned = boxes.turned_to(box, 1.0)
    assert (turned.center, turned.size) == (box.center, box.size)
    assert boxes.box_yaw(turned) == pytest.approx(1.0)


def test_what_is_round():
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert boxes.is_round(circle)
    assert boxes.is_round(0.03 * circle + [5.0, -2.0])
    assert not boxes.is_round(np.concatenate([circle, [[1.4, 0.0]]])), "a cup with a handle"
    assert not boxes.is_round(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))
    assert not boxes.is_round(np.array([[0, 0], [1, 0]]))

"""Hulls, support surfaces and sums against closed forms and second implementations."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.segment.backends.objects.cuts import pixels_by_label
from scenewright.stages.segment.backends.objects.hulls import convex_hull, hull_content, hull_span, inside_hull
from scenewright.stages.segment.backends.objects.pairs import inverse_plane
from scenewright.stages.segment.backends.objects.regions import POINT_SUMS, lab_image
from scenewright.stages.segment.backends.objects.segmentation import _holes_closed
from scenewright.stages.segment.backends.objects.support import SupportSettings, find_supports, surface_inverse

from tests.unit.segment.scenes import CAMERA, plane_depth, rays


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)), min_size=3, max_size=40))
def test_hull_is_opencvs(points: list[tuple[int, int]]) -> None:
    array = np.array(points, dtype=np.float64)
    ours = convex_hull(array)
    theirs = cv2.convexHull(array.astype(np.float32))
    assert cv2.contourArea(ours.astype(np.float32)) == pytest.approx(cv2.contourArea(theirs))
    assert {tuple(p) for p in ours} <= {tuple(p) for p in array}
    assert all(inside_hull(ours, x, y) for x, y in array)


def test_span_of_a_triangle() -> None:
    hull = convex_hull(np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]]))
    assert hull_span(hull, 5.0) == pytest.approx((0.0, 5.0))
    first, last = hull_span(hull, 11.0)
    assert first > last


def test_content_of_a_hull_with_an_occluder_a_gap_and_a_background() -> None:
    groups = np.zeros((40, 100), dtype=np.int32)
    inverse = np.full((40, 100), 0.5, dtype=np.float32)
    groups[:, :30], groups[:, 70:] = 1, 2
    inverse[:, :30] = inverse[:, 70:] = 1.0
    groups[:, 30:50], inverse[:, 30:50] = 3, 1.5  # nearer
    inverse[:, 50:60] = 0.0  # no depth
    hull = convex_hull(np.array([[0.0, 0.0], [99.0, 0.0], [99.0, 39.0], [0.0, 39.0]]))
    content = hull_content(hull, groups, inverse, 1, 2, np.array([1.0, 0.0, 0.0]), 0.02, 1)
    assert content == (60 * 40, 20 * 40, 10 * 40, 10 * 40)


def test_plane_of_sums_is_the_plane() -> None:
    u, v = np.meshgrid(np.arange(200.0), np.arange(300.0))
    w = 0.8 + 0.0002 * u - 0.0003 * v
    sums = np.zeros(POINT_SUMS)
    sums[0] = u.size
    sums[13:22] = [a.sum() for a in (u, v, u * u, u * v, v * v, w, u * w, v * w, w * w)]
    plane, residual = inverse_plane(sums)
    assert plane == pytest.approx([0.8, 0.0002, -0.0003], rel=1e-3)
    assert residual < 1e-3


def test_support_of_a_tilted_table_with_a_bend() -> None:
    normal = (0.0, np.cos(0.6), np.sin(0.6))
    exact = plane_depth(rays(CAMERA), normal, 0.8)
    exact = np.where(exact < 2.0, exact, 0).astype(np.float32)
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    bent = 1 / np.maximum(exact, 1e-3) + 0.002 * ((u - 80) / 80) ** 2
    depth = np.where(exact > 0, 1 / bent, 0).astype(np.float32)
    surfaces = find_supports(depth, CAMERA, SupportSettings())
    assert len(surfaces) == 1
    assert surfaces[0].normal == pytest.approx([-x for x in normal], abs=0.01)
    assert surfaces[0].offset == pytest.approx(0.8, abs=0.01)
    error = np.abs(surface_inverse(surfaces[0], CAMERA) - bent)[depth > 0]
    assert error.max() < 5e-4


def test_no_depth_no_support() -> None:
    assert find_supports(np.zeros((CAMERA.height, CAMERA.width), np.float32), CAMERA, SupportSettings()) == []


def testpixels_by_label_are_those_of_a_stable_sort() -> None:
    labels = np.random.default_rng(0).integers(0, 5, (20, 30)).astype(np.int32)
    labels[labels == 3] = 0  # a label without pixels
    rows, columns, starts = pixels_by_label(labels, 4)
    order = np.argsort(labels.ravel(), kind="stable")
    order = order[labels.ravel()[order] > 0]
    assert np.array_equal(rows * 30 + columns, order)
    assert np.array_equal(np.diff(starts), [0, *np.bincount(labels.ravel(), minlength=5)[1:]])


def test_a_hole_is_closed_where_one_object_surrounds_it_and_there_is_depth() -> None:
    labels = np.zeros((30, 40), np.int32)
    labels[2:20, 2:20], labels[2:20, 20:38] = 1, 2
    labels[5:8, 5:8] = 0  # inside the first
    labels[5:8, 19:22] = 0  # between the two
    labels[12:18, 25:36] = 0  # inside the second, too large
    valid = np.ones(labels.shape, bool)
    valid[6, 6] = False
    expected = labels.copy()
    expected[5:8, 5:8] = 1
    expected[6, 6] = 0
    assert np.array_equal(_holes_closed(labels, valid, 50), expected)


def test_a_window_of_the_lab_image_is_cut_out_of_the_whole() -> None:
    color = np.random.default_rng(0).integers(0, 256, (40, 50, 3)).astype(np.uint8)
    whole = lab_image(color, (slice(0, 40), slice(0, 50)))
    for window in ((slice(7, 31), slice(9, 44)), (slice(0, 12), slice(1, 50))):
        assert np.allclose(lab_image(color, window), whole[window], atol=1e-3)

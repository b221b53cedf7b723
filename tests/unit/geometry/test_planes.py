"""RANSAC planes on clouds whose planes are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.kit.geometry import planes
from scenewright.stages.kit.geometry.point_clouds import normals_of_neighbours


def sheet(random, center, first, second, count, noise=0.0):
    """Points on the parallelogram center + [-.5, .5] first + [-.5, .5] second, and their unit normals."""
    u, v = random.uniform(-0.5, 0.5, size=(2, count, 1))
    normal = np.cross(first, second)
    normal = normal / np.linalg.norm(normal)
    points = np.asarray(center) + u * np.asarray(first) + v * np.asarray(second)
    return points + noise * random.normal(size=(count, 1)) * normal, np.tile(normal, (count, 1))


@given(st.integers(0, 2**31))
@settings(max_examples=25, deadline=None)
def test_ransac_finds_a_plane_among_outliers(seed):
    random = np.random.default_rng(seed)
    normal = random.normal(size=3)
    normal /= np.linalg.norm(normal)
    first, second = planes.plane_axes(normal)
    center = random.uniform(-2, 2, size=3)
    points, _ = sheet(random, center, 2 * first, 2 * second, 600, noise=0.002)
    clutter = center + random.uniform(-1, 1, size=(600, 3))
    fit = planes.ransac_plane(np.concatenate([points, clutter]), distance_threshold=0.01, random=random)
    assert abs(fit.normal @ normal) > math.cos(math.radians(1.5))
    assert abs(fit.normal @ center + fit.offset) < 0.01
    assert np.count_nonzero(fit.inliers < 600) > 590
    assert np.linalg.norm(fit.normal) == pytest.approx(1.0)
    assert np.all(np.diff(fit.inliers) > 0)


@given(st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_refit_is_least_squares(seed):
    """Second implementation: singular value decomposition of the inliers."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(200, 3)) * [2, 1, 0.05]
    normal, offset = planes.fit_plane(points)
    centred = points - points.mean(axis=0)
    reference = np.linalg.svd(centred)[2][2]
    assert abs(normal @ reference) == pytest.approx(1.0, abs=1e-9)
    assert offset == pytest.approx(-normal @ points.mean(axis=0))


def test_normals_separate_the_two_faces_of_a_thin_board():
    random = np.random.default_rng(0)
    top, up = sheet(random, (0, 0, 0.02), (1, 0, 0), (0, 1, 0), 800)
    under, down = sheet(random, (0, 0, 0.0), (0, 1, 0), (1, 0, 0), 500)
    points, normals = np.concatenate([top, under]), np.concatenate([up, down])
    both = planes.ransac_plane(points, distance_threshold=0.03, random=np.random.default_rng(1))
    assert len(both.inliers) == 1300
    found = planes.ransac_planes(points, normals, distance_threshold=0.03, random=np.random.default_rng(1))
    assert [len(plane.inliers) for plane in found] == [800, 500]
    assert found[0].normal[2] == pytest.approx(1.0) and found[1].normal[2] == pytest.approx(-1.0)
    assert found[0].offset == pytest.approx(-0.02) and found[1].offset == pytest.approx(0.0, abs=1e-12)


def test_planes_of_a_box_and_the_share_below_which_they_are_dropped():
    random = np.random.default_rng(3)
    parts = [
        sheet(random, (0, 0, 1), (1, 0, 0), (0, 1, 0), 1000),
        sheet(random, (0.5, 0, 0.5), (0, 1, 0), (0, 0, 1), 600),
        sheet(random, (0, -0.5, 0.5), (1, 0, 0), (0, 0, 1), 400),
        sheet(random, (0, 0.5, 0.5), (0, 0, 1), (1, 0, 0), 60),
    ]
    points, normals = np.concatenate([p for p, _ in parts]), np.concatenate([n for _, n in parts])
    found = planes.ransac_planes(points, normals, distance_threshold=0.01, random=np.random.default_rng(0))
    assert len(found) == 3
    expected = [(0, 0, 1), (1, 0, 0), (0, -1, 0)]
    for plane, normal in zip(found, expected, strict=True):
        assert plane.normal @ np.array(normal) > 0.9999
    claimed = np.concatenate([plane.inliers for plane in found])
    assert len(np.unique(claimed)) == len(claimed)


def test_direction_limits_the_search():
    random = np.random.default_rng(5)
    wall, _ = sheet(random, (0, 0, 0), (0, 1, 0), (0, 0, 1), 900)
    floor, _ = sheet(random, (1, 0, -1), (1, 0, 0), (0, 1, 0), 300)
    points = np.concatenate([wall, floor])
    free = planes.ransac_plane(points, distance_threshold=0.01, random=np.random.default_rng(0))
    assert abs(free.normal[0]) > 0.999
    upright = planes.ransac_plane(
        points,
        distance_threshold=0.01,
        random=np.random.default_rng(0),
        direction=np.array([0, 0, 1.0]),
        maximum_angle=0.2,
    )
    assert upright.normal[2] > 0.999 and len(upright.inliers) >= 300


def test_same_seed_same_planes_and_no_planes_in_nothing():
    points = np.random.default_rng(0).normal(size=(5000, 3))
    first = planes.ransac_plane(points, distance_threshold=0.1, random=np.random.default_rng(7))
    second = planes.ransac_plane(points, distance_threshold=0.1, random=np.random.default_rng(7))
    assert np.array_equal(first.normal, second.normal) and np.array_equal(first.inliers, second.inliers)
    random = np.random.default_rng(0)
    assert planes.ransac_plane(points[:2], distance_threshold=0.1, random=random) is None
    assert planes.ransac_plane(np.zeros((10, 3)), distance_threshold=0.1, random=random) is None
    assert planes.ransac_planes(points[:0], distance_threshold=0.1, random=random) == []
    with pytest.raises(ValueError, match="N, 3"):
        planes.ransac_plane(points[:, :2], distance_threshold=0.1, random=random)
    with pytest.raises(ValueError, match="match"):
        planes.ransac_plane(points, normals=points[:5], distance_threshold=0.1, random=random)


def test_rectangle_of_a_tilted_sheet():
    random = np.random.default_rng(0)
    normal = np.array([1.0, 2.0, 2.0]) / 3
    first, second = planes.plane_axes(normal)
    turned = math.cos(0.4) * first + math.sin(0.4) * second
    across = np.cross(normal, turned)
    points, _ = sheet(random, (1, 2, 3), 2 * turned, 0.5 * across, 20000)
    corners, area = planes.plane_rectangle(points, normal)
    assert area == pytest.approx(1.0, rel=0.01)
    assert np.allclose(corners.mean(axis=0), (1, 2, 3), atol=0.01)
    assert np.allclose((corners - (1, 2, 3)) @ normal, 0, atol=1e-9)
    assert np.cross(corners[1] - corners[0], corners[2] - corners[1]) @ normal == pytest.approx(area, rel=1e-6)
    with pytest.raises(ValueError, match="inliers"):
        planes.plane_rectangle(np.zeros((0, 3)), normal)


def test_neighbours_on_a_plane_give_its_normal() -> None:
    random = np.random.default_rng(3)
    normals = random.normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = random.normal(size=(20, 8, 3))
    on_planes = offsets - np.einsum("nki,ni->nk", offsets, normals)[..., None] * normals[:, None]
    found = normals_of_neighbours(on_planes + random.normal(size=(20, 1, 3)))
    np.testing.assert_allclose(np.abs(np.einsum("ni,ni->n", found, normals)), 1.0, atol=1e-9)

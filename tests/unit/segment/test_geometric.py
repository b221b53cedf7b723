"""Convexity segmentation on analytic depth: creases and jumps separate, smooth convex surfaces stay whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.segment.geometric import (
    GeometricSettings,
    depth_discontinuity,
    label_regions,
    minimum_convexity,
    nearest_of_grid,
    relabel,
    segment_depth,
    taken,
)
from scenewright.stages.segment.normals import surface_normals

from tests.unit.segment.scenes import CAMERA, best_overlap, box_depth, combine, plane_depth, rays, sphere_depth

SMALL = GeometricSettings(normal_window=7, normal_step=1, minimum_pixels=600)
"""At 160x120 a window of 7 is what 13 is at about 320x240; 600 becomes 38 pixels."""
RAYS = rays(CAMERA)
TABLE = plane_depth(RAYS, (0.0, np.cos(0.9), np.sin(0.9)), 1.2)
"""A plane that rises away from the camera, as a table seen from above."""


def count_large(labels: np.ndarray, pixels: int = 150) -> int:
    return int((np.bincount(labels.ravel())[1:] >= pixels).sum())


def test_normals_of_a_plane_are_its_normal() -> None:
    normals = surface_normals(back_project(TABLE.astype(np.float32), CAMERA))
    expected = -np.array([0.0, np.cos(0.9), np.sin(0.9)])
    assert np.abs(normals[10:-10, 10:-10] - expected).max() < 1e-3


@pytest.mark.parametrize("step", [1, 2])
def test_normals_of_a_sphere_point_from_its_centre(step: int) -> None:
    depth, which = combine(sphere_depth(RAYS, (0.0, 0.0, 1.0), 0.3))
    points = back_project(depth, CAMERA)
    normals = surface_normals(points, window=7, step=step)
    radial = (points - [0, 0, 1.0]) / 0.3
    inner = np.hypot(*(np.mgrid[0:120, 0:160] - np.array([59.5, 79.5])[:, None, None])) < 25
    cosine = (normals * radial).sum(axis=-1)[inner & (which == 1)]
    assert cosine.min() > np.cos(np.radians(3))


def test_normals_match_the_eigenvectors_of_numpy() -> None:
    random = np.random.default_rng(3)
    depth = (1.0 + 0.02 * random.standard_normal((12, 12))).astype(np.float32)
    camera = Camera(width=12, height=12, fx=60, fy=60, cx=5.5, cy=5.5)
    points = back_project(depth, camera)
    normals = surface_normals(points, window=5, step=1, distance_factor=10.0)
    for v, u in [(5, 5), (2, 9), (0, 0), (11, 3)]:
        patch = points[max(0, v - 2) : v + 3, max(0, u - 2) : u + 3].reshape(-1, 3).astype(float)
        expected = np.linalg.eigh(np.cov(patch.T))[1][:, 0]
        assert abs(expected @ normals[v, u]) > 1 - 1e-5


def test_normals_do_not_mix_both_sides_of_a_jump() -> None:
    depth = np.full((120, 160), 1.0, dtype=np.float32)
    depth[:, 80:] = 2.0
    normals = surface_normals(back_project(depth, CAMERA))
    assert np.abs(normals[10:-10, 10:-10] - [0, 0, -1]).max() < 1e-3


def test_convexity_of_a_valley_and_of_a_ridge() -> None:
    for slope, concave in [(1.0, False), (-1.0, True)]:
        x = RAYS[..., 0]
        # The wedge z = 1 + slope |X| with X = x z: a ridge towards the camera when slope > 0, a valley when < 0.
        depth = (1.0 / (1.0 - slope * np.abs(x))).astype(np.float32)
        points = back_project(depth, CAMERA)
        convexity = minimum_convexity(points, surface_normals(points, window=7, step=1))
        crease = convexity[20:-20, 78:82]
        flat = convexity[20:-20, 20:50]
        assert flat.min() > 0.999
        assert crease.max() < 0.9 if concave else crease.min() > 0.97


def test_discontinuity_is_relative_to_depth() -> None:
    depth = np.full((10, 20), 2.0, dtype=np.float32)
    depth[:, 10:] = 2.03
    assert depth_discontinuity(depth, ratio=0.01)[:, 9:11].all()
    assert not depth_discontinuity(depth, ratio=0.01)[:, :9].any()
    assert not depth_discontinuity(depth, ratio=0.02).any()
    depth[4, 4] = 0
    assert not depth_discontinuity(depth, ratio=0.02).any(), "missing depth is no jump"


def test_box_on_a_plane() -> None:
    box = box_depth(RAYS, (0.05, 0.35, 1.22), (0.3, 0.3, 0.3), 0.6)
    depth, which = combine(TABLE, box)
    labels = segment_depth(depth, CAMERA, SMALL).labels
    table, table_overlap = best_overlap(labels, which == 1)
    thing, box_overlap = best_overlap(labels, which == 2)
    assert table != thing
    assert table_overlap > 0.9
    assert box_overlap > 0.8
    # Two faces of the box meet in a convex edge: they are one segment.
    assert count_large(labels) == 2


def test_without_the_crease_everything_is_one_segment() -> None:
    labels = segment_depth(TABLE.astype(np.float32), CAMERA, SMALL).labels
    assert labels.max() == 1 and (labels == 1).mean() > 0.99


def test_a_large_image_is_cut_where_every_second_pixel_tells() -> None:
    """Twice as many pixels of the same scene, one grid: edges stay within a pixel of it."""
    fine = Camera(width=640, height=480, fx=560.0, fy=560.0, cx=319.5, cy=239.5)
    seen = rays(fine)
    table = plane_depth(seen, (0.0, np.cos(0.9), np.sin(0.9)), 1.2)
    depth, which = combine(table, box_depth(seen, (0.05, 0.35, 1.22), (0.3, 0.3, 0.3), 0.6))
    found = segment_depth(depth, fine, replace(SMALL, grid_columns=320))
    assert found.labels.shape == depth.shape and found.grid_normals.shape == (240, 320, 3)
    thing = best_overlap(found.labels, which == 2)
    assert best_overlap(found.labels, which == 1)[0] != thing[0] and thing[1] > 0.9
    assert np.array_equal(found.normals[::2, ::2], found.grid_normals * (found.source[::2, ::2, None] >= 0))


def test_pixels_between_are_like_the_grid_pixel_nearest_in_depth() -> None:
    depth = np.array([[1.0, 1.0, 2.0], [1.0, 1.9, 2.0], [0.0, 1.5, 2.0]], np.float32)
    grid = depth[::2, ::2].copy()
    assert nearest_of_grid(depth, grid, 2, 0.1).tolist() == [[0, 0, 1], [0, 1, 1], [-1, -1, 3]]
    labels = np.array([[5, 6], [0, 7]], np.int32)
    assert taken(labels, nearest_of_grid(depth, grid, 2, 0.1)).tolist() == [[5, 5, 6], [5, 6, 6], [0, 0, 7]]


def test_two_touching_boxes_at_an_angle() -> None:
    left = box_depth(RAYS, (-0.21, 0.0, 1.2), (0.4, 0.5, 0.2), 0.7)
    right = box_depth(RAYS, (0.16, 0.0, 1.2), (0.4, 0.5, 0.2), -0.7)
    depth, which = combine(left, right)
    labels = segment_depth(depth, CAMERA, SMALL).labels
    first, first_overlap = best_overlap(labels, which == 1)
    second, second_overlap = best_overlap(labels, which == 2)
    assert first != second and min(first_overlap, second_overlap) > 0.8


def test_sphere_stays_one_segment() -> None:
    depth, which = combine(sphere_depth(RAYS, (0.0, 0.0, 1.0), 0.3))
    labels = segment_depth(depth, CAMERA, SMALL).labels
    assert count_large(labels, 20) == 1
    assert best_overlap(labels, which == 1)[1] > 0.95


def test_sensor_noise_does_not_shatter_a_plane() -> None:
    random = np.random.default_rng(0)
    camera = Camera(width=640, height=480, fx=560.0, fy=560.0, cx=319.5, cy=239.5)
    directions = rays(camera)
    depth, which = combine(
        plane_depth(directions, (0.0, np.cos(0.9), np.sin(0.9)), 1.2),
        box_depth(directions, (0.05, 0.35, 1.22), (0.3, 0.3, 0.3), 0.6),
    )
    noisy = depth + (0.0019 * (depth - 0.4) ** 2 + 0.0012) * random.standard_normal(depth.shape)
    labels = segment_depth(noisy.astype(np.float32), camera).labels
    assert best_overlap(labels, which == 1)[1] > 0.85
    assert best_overlap(labels, which == 2)[1] > 0.7


def test_missing_depth_has_no_label_and_an_empty_image_no_segment() -> None:
    depth = TABLE.astype(np.float32).copy()
    depth[30:60, 40:80] = 0
    labels = segment_depth(depth, CAMERA, SMALL).labels
    assert not labels[30:60, 40:80].any() and labels.max() == 1
    assert segment_depth(np.zeros((120, 160), np.float32), CAMERA, SMALL).labels.max() == 0


def flat_image(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    camera = Camera(width=depth.shape[1], height=depth.shape[0], fx=100, fy=100, cx=0, cy=0)
    normals = np.zeros((*depth.shape, 3), dtype=np.float32)
    normals[..., 2] = -1
    return back_project(depth, camera), normals


def test_small_regions_join_what_surrounds_them() -> None:
    points, normals = flat_image(np.ones((40, 60)))
    edges = np.zeros((40, 60), dtype=bool)
    edges[:, 29:31] = True  # two large halves
    edges[9:16, 9:16] = True
    edges[10:15, 10:15] = False  # a small island in the left half
    labels = label_regions(edges, points, normals, minimum_pixels=100, ratio=0.01)
    assert labels.max() == 2 and (labels > 0).all()
    assert len(np.unique(labels[:, :29])) == 1
    assert label_regions(edges, points, normals, minimum_pixels=10, ratio=0.01).max() == 3


def test_edges_do_not_cross_a_jump_when_filled() -> None:
    depth = np.ones((20, 40))
    depth[:, 20:] = 1.5
    points, normals = flat_image(depth)
    edges = np.zeros((20, 40), dtype=bool)
    edges[:, 16:24] = True
    labels = label_regions(edges, points, normals, minimum_pixels=10, ratio=0.01)
    assert (labels[:, :20] == 1).all() and (labels[:, 20:] == 2).all()


def test_relabel_counts_in_order_of_appearance() -> None:
    assert relabel(np.array([[0, 7, 7], [3, 0, 9]])).tolist() == [[0, 1, 1], [2, 0, 3]]
    assert relabel(np.array([[5, 2]])).tolist() == [[1, 2]]


def test_the_same_depth_gives_the_same_labels() -> None:
    depth, _ = combine(TABLE, sphere_depth(RAYS, (0.0, 0.2, 1.2), 0.2))
    first = segment_depth(depth, CAMERA, SMALL).labels
    assert np.array_equal(first, segment_depth(depth, CAMERA, SMALL).labels)

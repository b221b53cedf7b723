"""Boxes over a surface: they cover it, they leave the inside free."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.kit.geometry.box_cover import cover_with_boxes, merge_cells


@settings(max_examples=50, deadline=None)
@given(st.sets(st.tuples(*[st.integers(0, 4)] * 3), min_size=1, max_size=60))
def test_cuboids_partition_the_cells(cells):
    covered: list[tuple[int, ...]] = []
    for first, last in merge_cells(np.array(sorted(cells))):
        ranges = [range(a, b + 1) for a, b in zip(first, last, strict=True)]
        covered += [(i, j, k) for i in ranges[0] for j in ranges[1] for k in ranges[2]]
    assert sorted(covered) == sorted(cells)


def test_a_full_block_is_one_cuboid():
    cells = np.argwhere(np.ones((3, 4, 5), dtype=bool))
    assert len(merge_cells(cells)) == 1


def open_box(yaw: float) -> trimesh.Trimesh:
    """A box 0.6 x 0.4 x 0.5 m without lid."""
    mesh = trimesh.creation.box((0.6, 0.4, 0.5))
    mesh.update_faces(mesh.face_normals[:, 2] < 0.5)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(yaw, [0, 0, 1]))
    return mesh


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_an_open_box_is_covered_and_stays_open(yaw):
    boxes = cover_with_boxes(open_box(yaw), yaw)
    assert len(boxes) == 5
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    surface = trimesh.sample.sample_surface(open_box(yaw), 500, seed=0)[0] @ turn.T
    center, half = np.array([c for c, _ in boxes]), np.array([s / 2 for _, s in boxes])

    def covered(points: np.ndarray, margin: float) -> np.ndarray:
        return (np.abs(points[:, None] - center) <= half + margin).all(axis=2).any(axis=1)

    assert covered(surface, 1e-6).all()
    inside = np.random.default_rng(0).uniform([-0.29, -0.19, -0.24], [0.29, 0.19, 0.3], (500, 3))
    assert not covered(inside, 0.0).any()


def test_the_number_of_boxes_is_bounded():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    assert len(cover_with_boxes(ball, voxel_size=0.1, maximum=30)) <= 30
    with pytest.raises(ValueError, match="no triangles"):
        cover_with_boxes(trimesh.Trimesh())

"""Plates with holes: boxes that fill the mask, and one closed surface of the same volume."""

from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.cad.panels import closed_plate, rectangles_of, without_corner_contacts


def test_a_wall_with_a_door_and_a_window():
    """4 x 2.5 m in squares of 0.1 m, a door of 0.9 x 2.0 m and a window of 1.0 x 0.8 m."""
    solid = np.ones((40, 25), bool)
    solid[5:14, :20] = False
    solid[25:35, 10:18] = False
    vertices, faces = closed_plate(solid, 0.1 * np.arange(41), 0.1 * np.arange(26), 0.1)
    plate = trimesh.Trimesh(vertices, faces)
    assert plate.is_watertight and plate.is_winding_consistent
    assert np.isclose(plate.volume, 0.1 * (4 * 2.5 - 0.9 * 2.0 - 1.0 * 0.8))
    assert np.allclose(plate.bounds, [[0, 0, -0.1], [4, 2.5, 0]])
    assert not plate.contains([[0.9, 1.0, -0.05], [3.0, 1.4, -0.05]]).any()
    assert len(rectangles_of(solid)) <= 7
    assert plate.euler_number == 0, "the window is a hole through it, the door is none"


@given(st.integers(0, 2**31), st.integers(1, 9), st.integers(1, 9))
@settings(max_examples=60, deadline=None)
def test_any_mask_becomes_a_closed_surface_and_boxes_that_fill_it(seed, wide, high):
    random = np.random.default_rng(seed)
    solid = random.random((wide, high)) < 0.6
    kept = without_corner_contacts(solid)
    assert not (kept & ~solid).any()
    filled = np.zeros_like(kept, dtype=int)
    for left, low, right, top in rectangles_of(kept):
        filled[left:right, low:top] += 1
    assert (filled == kept).all()
    if kept.any():
        columns = np.cumsum(random.uniform(0.1, 1.0, wide + 1))
        rows = np.cumsum(random.uniform(0.1, 1.0, high + 1))
        vertices, faces = closed_plate(kept, columns, rows, 0.3)
        plate = trimesh.Trimesh(vertices, faces)
        assert plate.is_watertight and plate.is_winding_consistent
        area = (np.diff(columns)[:, None] * np.diff(rows) * kept).sum()
        assert np.isclose(plate.volume, 0.3 * area)

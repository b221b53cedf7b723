"""Aprons: of what stands on a top, the level surface around its foot is of the top; what lies flat on one is not."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.fuse.aprons import without_aprons

from tests.unit.fuse.rooms import Corners
from tests.unit.fuse.test_joining import VOXEL, room

TABLE = ((-0.6, -0.4, 0.0), (0.6, 0.4, 0.7))


def around(scene_vertices: np.ndarray, reach: float) -> np.ndarray:
    """Return which vertices (V,) are of the table's top, within `reach` [m] of its middle."""
    return (np.abs(scene_vertices[:, :2]) < reach).all(axis=1) & (np.abs(scene_vertices[:, 2] - 0.7) < 0.001)


@pytest.mark.parametrize(
    ("box", "has_apron"),
    [
        (((-0.1, -0.1, 0.7), (0.1, 0.1, 1.0)), True),
        (((-0.1, -0.1, 0.7), (0.1, 0.1, 0.72)), False),  # a magazine: nothing rises over what would be its apron
    ],
)
def test_level_surface_around_a_foot_goes_to_the_top(box: Corners, has_apron: bool) -> None:
    scene, truth = room(TABLE, box)
    masks = np.where((truth == 1) & around(scene.vertices, 0.16), 2, truth)
    assert (masks != truth).sum() > 50
    told = np.where(masks != truth, 0.3, 0.8)
    found = without_aprons(scene, masks, told, {1, 2}, VOXEL)
    np.testing.assert_array_equal(found, truth if has_apron else masks)
    assert without_aprons(scene, masks, told, {2}, VOXEL).tolist() == masks.tolist(), "no other thing has a top there"
    sure = np.full(len(masks), 0.8)
    assert without_aprons(scene, masks, sure, {1, 2}, VOXEL).tolist() == masks.tolist(), "the plate under a lamp"


def test_what_a_thing_stands_over_is_its_own() -> None:
    """A seat that goes on flush in the cushion of a bench has legs under it."""
    scene, truth = room(TABLE, ((0.6, -0.1, 0.0), (0.8, 0.1, 0.7)), ((0.78, -0.1, 0.7), (0.8, 0.1, 1.6)))
    chair = np.where(truth == 3, 2, truth)
    told = np.where(scene.normals[:, 2] > 0.9, 0.3, 0.8)
    np.testing.assert_array_equal(without_aprons(scene, chair, told, {1, 2}, VOXEL), chair)


def test_nothing_at_all() -> None:
    scene, truth = room(TABLE)
    assert (
        without_aprons(scene, np.zeros_like(truth), np.zeros(len(truth)), {1}, VOXEL).tolist()
        == np.zeros_like(truth).tolist()
    )

"""Symmetries of shapes whose group is known, and rotation errors modulo them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.stages.kit.measurement.shape_symmetry import (
    NO_SYMMETRY,
    Symmetry,
    cube_rotations,
    rotation_angle,
    shape_symmetry,
    symmetric_rotation_error,
)
from scipy.spatial.transform import Rotation


def samples(mesh: trimesh.Trimesh) -> np.ndarray:
    return np.asarray(trimesh.sample.sample_surface(mesh, 2000, seed=0)[0])


def box(x, y, z, at=(0, 0, 0)) -> trimesh.Trimesh:
    return trimesh.creation.box(extents=(x, y, z), transform=trimesh.transformations.translation_matrix(at))


def test_the_cube_has_24_rotations_that_form_a_group():
    rotations = cube_rotations()
    assert len(rotations) == 24 and np.array_equal(rotations[0], np.eye(3))
    known = {rotation.tobytes() for rotation in (r + 0.0 for r in rotations)}
    products = {((a @ b) + 0.0).tobytes() for a in rotations for b in rotations}
    assert products == known


@pytest.mark.parametrize(
    ("mesh", "count", "is_round"),
    [
        (box(1, 2, 3), 4, False),  # half turns about each axis
        (box(1, 1, 3), 8, False),
        (box(1, 1, 1), 24, False),
        (trimesh.creation.cylinder(radius=0.5, height=3, sections=64), 8, True),
        (trimesh.creation.cone(radius=0.5, height=1, sections=64), 4, True),  # not upside down
        (trimesh.util.concatenate([box(1, 0.6, 0.1), box(0.1, 0.6, 1, (0.45, 0, 0.5))]), 2, False),  # an L: not z
    ],
)
def test_symmetry_of_known_shapes(mesh, count, is_round):
    symmetry = shape_symmetry(samples(mesh) + [3.0, -2.0, 1.0])
    assert len(symmetry.rotations) == count
    assert symmetry.round == is_round


def test_rotation_error_forgives_the_symmetry_and_nothing_else():
    half = Symmetry((np.eye(3), np.diag([-1.0, -1.0, 1.0])))
    true = Rotation.from_euler("z", 0.4).as_matrix()
    turned = true @ Rotation.from_euler("z", np.pi + 0.1).as_matrix()
    error, rotation = symmetric_rotation_error(true, turned, half)
    assert error == pytest.approx(0.1) and np.array_equal(rotation, np.diag([-1.0, -1.0, 1.0]))
    assert symmetric_rotation_error(true, turned, NO_SYMMETRY)[0] == pytest.approx(np.pi - 0.1)
    round_thing = Symmetry(round=True)
    assert symmetric_rotation_error(true, turned, round_thing)[0] == pytest.approx(0.0, abs=1e-12)
    leaning = turned @ Rotation.from_euler("x", 0.3).as_matrix()
    assert symmetric_rotation_error(true, leaning, round_thing)[0] == pytest.approx(0.3)


def test_rotation_angle_is_exact_at_both_ends():
    for angle in (0.0, 1e-9, 1.0, np.pi - 1e-9, np.pi):
        rotation = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])).as_matrix()
        assert rotation_angle(rotation) == pytest.approx(angle, abs=1e-12)

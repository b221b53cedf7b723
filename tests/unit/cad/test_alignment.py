"""Equations 2.11 to 2.14, and Levenberg-Marquardt on shapes whose pose is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.cad.alignment import (
    AlignmentWeights,
    align,
    box_errors,
    convex_overlap_area,
    levenberg_marquardt,
    plane_errors,
    rectangle,
    residual_function,
)
from scenewright.stages.cad.matching import Match
from scenewright.stages.cad.shapes import Observed, Planes, shape_of_state
from scenewright.stages.kit.geometry.boxes import clip_polygon, polygon_area
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

WEIGHTS = AlignmentWeights(support=8.0, offset=5.0, angle=5.0, containment=0.5, height=2.0)


@given(st.integers(0, 2**31))
@settings(max_examples=60, deadline=None)
def test_overlap_matches_polygon_clipping(seed):
    random = np.random.default_rng(seed)
    a, b = (rectangle(random.uniform(-1, 1, 2), random.uniform(0.2, 2, 2), random.uniform(-4, 4)) for _ in range(2))
    assert convex_overlap_area(a, b) == pytest.approx(max(0.0, polygon_area(clip_polygon(a, b))), abs=1e-9)


def test_box_errors_are_2_13():
    frame = Observed(0.0, np.array([0, 0, 0.5]), np.array([2.0, 1, 1]), None, 0.0)
    inside = box_errors(
        frame.center, frame.size, frame.yaw, np.array([1.0, 0.5, 0.5]), 1.2, 0.0, np.array([0.1, 0, 0.3])
    )
    assert inside == pytest.approx([0.0, 1.2 * 0.5 - 1.0])
    outside = box_errors(
        frame.center, frame.size, frame.yaw, np.array([2.0, 1.0, 1.0]), 1.0, 0.0, np.array([0.5, 0, 0.5])
    )
    assert outside == pytest.approx([0.5, 0.0])


def test_plane_errors_are_2_14():
    """Against T^-T applied to homogeneous planes."""
    random = np.random.default_rng(0)
    normals_x = random.normal(size=(4, 3))
    normals_x /= np.linalg.norm(normals_x, axis=1, keepdims=True)
    normals_y = random.normal(size=(4, 3))
    normals_y /= np.linalg.norm(normals_y, axis=1, keepdims=True)
    offsets_x, offsets_y, shift, scale = random.random(4), random.random(4), random.random(3), 1.3
    offset, angle = plane_errors(normals_x, offsets_x, normals_y, scale * offsets_y, shift)
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = scale * np.eye(3), shift
    for k in range(4):
        moved = np.linalg.inv(transform).T @ np.array([*normals_y[k], offsets_y[k]])
        moved /= np.linalg.norm(moved[:3])
        assert offset[k] == pytest.approx(moved[3] - offsets_x[k])
        assert angle[k] == pytest.approx(1 - normals_x[k] @ normals_y[k])


def match_of(shape, scale, yaw, position, start_yaw, center_error=(0.0, 0.0, 0.0)):
    """A match whose observed planes are those of the shape at a known pose; the frame is a little wrong."""
    turn = Rotation.from_euler("z", yaw).as_matrix()
    position = np.asarray(position, dtype=float)
    center = position + np.asarray(center_error)
    normals = shape.planes.normals @ turn.T
    offsets = scale * shape.planes.offsets + normals @ (center - position)
    size = scale * shape.size
    frame = Observed(
        start_yaw, center, size, Planes(normals, offsets, np.zeros(len(offsets), dtype=bool)), position[2] - size[2] / 2
    )
    return Match(shape, frame, 0, 0.0, tuple((k, k) for k in range(len(offsets))))


@given(st.floats(0.7, 1.5), st.floats(-3, 3), st.floats(-0.2, 0.2), st.floats(-0.05, 0.05))
@settings(max_examples=25, deadline=None)
def test_alignment_recovers_scale_yaw_and_shift(library, scale, yaw, twist, push):
    model = next(m for m in library.info.models if m.id == "chair_low")
    shape = shape_of_state(model, model.states[0])
    match = match_of(shape, scale, yaw, (1.0, -2.0, 0.3 + scale * 0.45), yaw + twist, (push, -push, 0.0))
    # The footprint term pulls towards the wrong frame; without it the planes decide alone.
    found = align(match, AlignmentWeights(8.0, 5.0, 5.0, 0.0, 2.0), 1000)
    assert found.cost < 1e-6
    assert found.scale == pytest.approx(scale, rel=1e-3)
    assert abs((found.yaw - yaw + math.pi) % (2 * math.pi) - math.pi) < 0.03
    assert np.allclose(found.position, (1.0, -2.0, 0.3 + scale * 0.45), atol=5e-3)


def test_height_follows_from_the_supporting_plane(library):
    model = next(m for m in library.info.models if m.id == "table_square")
    shape = shape_of_state(model, model.states[0])
    found = align(match_of(shape, 1.2, 0.4, (0, 0, 0.2 + 0.6 * 0.74), 0.5), WEIGHTS, 1000)
    assert found.position[2] == pytest.approx(0.2 + found.scale * shape.size[2] / 2, abs=1e-12)


def test_solver_agrees_with_scipy(library):
    model = next(m for m in library.info.models if m.id == "chair_low")
    shape = shape_of_state(model, model.states[0])
    match = match_of(shape, 1.1, 0.3, (0.5, 0.5, 0.5), 0.45, (0.05, 0.02, 0.0))
    residuals = residual_function(match, WEIGHTS)
    start = np.array([1.0, 0.45, *match.frame.center[:2]])
    _, cost = levenberg_marquardt(residuals, start, 2000, tolerance=1e-12)
    reference = least_squares(lambda x: residuals(x[None])[0], start, method="lm", max_nfev=4000)
    assert cost <= 2 * reference.cost * 1.01 + 1e-9


def test_solver_survives_fewer_residuals_than_parameters():
    solution, cost = levenberg_marquardt(lambda rows: rows[:, :1] - 3.0, np.zeros(4), 200)
    assert cost < 1e-8 and solution[0] == pytest.approx(3.0, abs=1e-4)
    assert np.allclose(solution[1:], 0)

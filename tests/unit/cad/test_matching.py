"""Equations 2.7 to 2.10 in closed form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.cad.matching import (
    CUBE_ROTATIONS,
    SUPPORTING_UNMATCHED,
    assign_planes,
    matching_error,
    plane_costs,
    rank_matches,
    size_error,
    upright_error,
)
from scenewright.stages.cad.shapes import Observed, Planes, shape_of_state
from scipy.spatial.transform import Rotation


def observed(size, planes=((), ()), yaw=0.0, supporting=None, center=(0, 0, 0)):
    normals = np.array(planes[0], dtype=float).reshape(-1, 3)
    offsets = np.array(planes[1], dtype=float)
    carries = np.zeros(len(offsets), dtype=bool) if supporting is None else np.array(supporting)
    return Observed(
        yaw, np.array(center, dtype=float), np.array(size, dtype=float), Planes(normals, offsets, carries), 0.0
    )


def test_the_24_rotations_of_a_cube():
    assert CUBE_ROTATIONS.shape == (24, 3, 3)
    assert len(np.unique(CUBE_ROTATIONS.reshape(24, 9), axis=0)) == 24
    for rotation in CUBE_ROTATIONS:
        assert np.allclose(rotation @ rotation.T, np.eye(3)) and np.linalg.det(rotation) == pytest.approx(1)
    assert all(rotation[2, 2] == 1 for rotation in CUBE_ROTATIONS[:4])
    # Second source: scipy's octahedral group.
    group = Rotation.create_group("O").as_matrix()
    for rotation in CUBE_ROTATIONS:
        assert np.min(np.abs(group - rotation).sum(axis=(1, 2))) < 1e-9


def test_size_error_is_2_8():
    assert size_error(np.array([1.0, 2, 2]), np.array([2.0, 4, 4])) == pytest.approx(0)
    a, b = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert size_error(a, b) == pytest.approx(np.sqrt(2))
    assert size_error(np.array([3.0, 4, 0]), np.array([4.0, 3, 0])) == pytest.approx(np.hypot(0.2, 0.2))


def test_upright_error_is_2_10():
    assert [upright_error(r) for r in CUBE_ROTATIONS[:4]] == [0.0] * 4
    assert sorted({upright_error(r) for r in CUBE_ROTATIONS}) == [0.0, 1.0, 2.0]


def test_plane_summand_is_2_9():
    tilt = np.array([[np.sin(0.3), 0, np.cos(0.3)]])
    cost = plane_costs(np.array([[0, 0, 1.0]]), np.array([0.5]), tilt, np.array([0.2]))
    assert cost[0, 0] == pytest.approx(0.3 + 1 - np.cos(0.3))


@given(st.integers(0, 2**31), st.integers(1, 4), st.integers(1, 5))
@settings(max_examples=60, deadline=None)
def test_assignment_is_the_best_of_all(seed, count_x, count_y):
    """Second implementation: try every injection, or leave planes out at their price."""
    random = np.random.default_rng(seed)
    costs = random.random((count_x, count_y))
    supporting_x, supporting_y = random.random(count_x) < 0.3, random.random(count_y) < 0.6
    for unmatched in (None, 0.4):
        best = np.inf
        targets = [*range(count_y)] + ([-1] * count_x if unmatched is not None else [])
        for choice in set(itertools.permutations(targets, count_x)):
            if any(supporting_x[i] and j >= 0 and not supporting_y[j] for i, j in enumerate(choice)):
                continue
            alone = [SUPPORTING_UNMATCHED if supporting else 1.0 for supporting in supporting_x]
            best = min(best, sum(alone[i] * unmatched if j < 0 else costs[i, j] for i, j in enumerate(choice)))
        found = assign_planes(costs, supporting_x, supporting_y, unmatched)
        if np.isinf(best):
            assert found is None
        else:
            assert found[0] == pytest.approx(best)
            assert len({j for _, j in found[1]}) == len(found[1])


def test_no_planes_cost_nothing_and_supports_are_preserved():
    none = np.zeros(0, dtype=bool)
    assert assign_planes(np.zeros((0, 3)), none, np.ones(3, dtype=bool), None) == (0.0, ())
    only = np.array([[0.0, 0.5]])
    carries = np.array([True])
    assert assign_planes(only, carries, np.array([False, True]), 1.0) == (0.5, ((0, 1),))
    assert assign_planes(only, carries, np.array([False, False]), None) is None
    assert assign_planes(only, carries, np.array([False, False]), 1.0) == (SUPPORTING_UNMATCHED, ())


def test_a_model_matches_itself_only_as_it_stands(library):
    """D = 0 (2.7) for the model's own planes and size, in any frame and at any scale; larger in all other turns."""
    model = next(m for m in library.info.models if m.id == "chair_low")
    shape = shape_of_state(model, model.states[0])
    for yaw, scale in ((0.0, 1.0), (0.7, 1.3)):
        turn = Rotation.from_euler("z", yaw).as_matrix()
        frame = Observed(
            yaw,
            np.array([3.0, -1.0, 0.4]),
            scale * shape.size,
            Planes(
                shape.planes.normals @ turn.T, scale * shape.planes.offsets, np.zeros(len(shape.planes), dtype=bool)
            ),
            0.0,
        )
        errors = [matching_error(frame, shape, rotation, (1, 1, 0.2), None)[0] for rotation in CUBE_ROTATIONS]
        assert errors[0] == pytest.approx(0, abs=1e-9)
        assert min(errors[1:]) > 0.1


def test_weights_of_2_7():
    model_free = observed((1, 2, 2))

    class Flat:
        size = np.array([2.0, 1, 2])
        planes = Planes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=bool))

    on_its_side = next(r for r in CUBE_ROTATIONS if upright_error(r) == 1.0)
    error, pairs = matching_error(model_free, Flat, on_its_side, (1.0, 1.0, 0.2), None)
    expected = size_error(np.array([1.0, 2, 2]), np.abs(on_its_side) @ Flat.size) + 0.2
    assert error == pytest.approx(expected) and pairs == ()


def test_ranking_rejects_absurd_scales(library):
    models = [m for m in library.info.models if m.class_name == "box"]
    shapes = [shape_of_state(m, m.states[0]) for m in models]
    keep = dict(weights=(1.0, 1.0, 0.2), unmatched=1.0, scale_range=(0.6, 1.6), keep=5)
    found, rejected = rank_matches([observed((0.3, 0.2, 0.1))], shapes, **keep)
    assert found[0].shape.model.id == "box_flat" and len(found) == 5
    assert rejected["matching rank"] == 48 - 5
    assert [m.error for m in found] == sorted(m.error for m in found)
    none, rejected = rank_matches([observed((3.0, 2.0, 1.0))], shapes, **keep)
    assert none == [] and rejected["scale out of range"] == 48
    upright, _ = rank_matches([observed((0.3, 0.2, 0.1))], shapes, **keep, upright_only=True)
    assert all(match.tilt == 0 for match in upright)

"""Penetration of convex pieces, and min-conflicts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.cad.conflicts import min_conflicts
from scenewright.stages.kit.geometry.convex_solids import convex_solid, penetration

from tests.panoptic_maps import box_mesh


def solid(*boxes):
    meshes = [box_mesh(low, high) for low, high in boxes]
    return convex_solid([(np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in meshes])


@given(st.floats(-1.5, 1.5))
@settings(max_examples=40, deadline=None)
def test_depth_of_two_cubes(shift):
    a, b = solid(((0, 0, 0), (1, 1, 1))), solid(((shift, 0.3, 0.4), (shift + 1, 1.3, 1.4)))
    overlap = 1.0 - abs(shift)
    expected = max(0.0, min(overlap, 0.6))
    assert penetration(a, b).depth == pytest.approx(expected, abs=1e-3)
    assert penetration(b, a).depth == pytest.approx(expected, abs=1e-3)


def test_direction_points_from_the_first_to_the_second():
    a, b = solid(((0, 0, 0), (1, 1, 1))), solid(((0.9, 0, 0), (1.9, 1, 1)))
    found = penetration(a, b)
    assert found.direction @ [1, 0, 0] == pytest.approx(1, abs=1e-3)
    assert penetration(b, a).direction @ [1, 0, 0] == pytest.approx(-1, abs=1e-3)


def test_pieces_of_a_frame_do_not_fill_its_hole():
    frame = solid(((0, 0, 0), (0.1, 1, 1)), ((0.9, 0, 0), (1, 1, 1)))
    assert penetration(frame, solid(((0.2, 0, 0), (0.8, 1, 1)))).depth == 0.0
    assert penetration(frame, convex_solid([])).depth == 0.0


def planted(table):
    """depth(i, a, j, b) from a dictionary of colliding choices."""

    def depth(i, a, j, b):
        return table.get((i, a, j, b), table.get((j, b, i, a), 0.0))

    return depth


def choose(counts, table, iterations=50, seed=0):
    return min_conflicts(
        counts, planted(table), tolerance=0.01, iterations=iterations, random=np.random.default_rng(seed)
    )


def test_a_planted_collision_is_resolved_by_an_alternative():
    found = choose(
        [3, 2], {(0, 0, 1, 0): 0.2, (0, 1, 1, 0): 0.1, (0, 0, 1, 1): 0.3, (0, 1, 1, 1): 0.1, (0, 2, 1, 1): 0.5}
    )
    assert found.conflicts_before == 1 and found.conflicts_after == 0
    assert found.choice == (2, 0)


def test_no_collision_keeps_the_best_and_takes_no_step():
    found = choose([5, 5, 5], {(0, 0, 1, 0): 0.009})
    assert found.choice == (0, 0, 0) and found.steps == 0 and found.conflicts_before == 0


def test_what_cannot_be_resolved_keeps_the_least_bad_choice():
    table = {(0, a, 1, b): 0.5 - 0.1 * (a == 1) for a in range(2) for b in range(2)}
    found = choose([2, 2], table)
    assert found.conflicts_after == 1 and found.steps == 50
    assert found.choice[0] == 1


@given(st.integers(0, 2**31), st.integers(2, 6), st.integers(1, 4))
@settings(max_examples=60, deadline=None)
def test_never_worse_than_the_start_and_repeatable(seed, objects, candidates):
    random = np.random.default_rng(seed)
    table = {
        (i, a, j, b): float(random.random() < 0.3) * 0.1
        for i in range(objects)
        for j in range(i + 1, objects)
        for a in range(candidates)
        for b in range(candidates)
    }
    found = choose([candidates] * objects, table, seed=seed)
    assert found.conflicts_after <= found.conflicts_before
    depth = planted(table)
    pairs = [(i, j) for i in range(objects) for j in range(i + 1, objects)]
    assert found.conflicts_after == sum(depth(i, found.choice[i], j, found.choice[j]) > 0.01 for i, j in pairs)
    assert choose([candidates] * objects, table, seed=seed) == found

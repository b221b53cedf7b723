"""A convex piece without a box: the pieces that are left fill the rest of it, and none reaches into the box."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.urdf.convex_cutting import THINNEST, half, outside_box
from scipy.spatial import ConvexHull

UNIT = np.array(list(itertools.product((0.0, 1.0), repeat=3)))


def volume(points: np.ndarray) -> float:
    return float(ConvexHull(points).volume)


@settings(deadline=None)
@given(st.tuples(*[st.tuples(st.integers(-5, 15), st.integers(1, 20))] * 3))
def test_what_is_left_of_a_cube_is_all_but_the_box(sides: tuple[tuple[int, int], ...]) -> None:
    low = np.array([start / 10 for start, _ in sides])
    high = low + [length / 10 for _, length in sides]
    left = outside_box(UNIT, low, high)
    shared = np.prod(np.clip(np.minimum(high, 1.0) - np.maximum(low, 0.0), 0.0, None))
    assert sum(volume(part) for part in left) == pytest.approx(1.0 - shared, abs=1e-9)
    for part in left:
        assert (part >= -1e-12).all() and (part <= 1 + 1e-12).all()
        inside = np.minimum(part.max(axis=0), high) - np.maximum(part.min(axis=0), low)
        assert inside.min() <= 1e-9, "an axis-aligned piece meets the box"


@settings(deadline=None)
@given(st.integers(0, 2**31), st.integers(0, 2), st.floats(-0.5, 0.5))
def test_two_halves_of_any_hull_make_the_whole(seed: int, axis: int, limit: float) -> None:
    points = np.random.default_rng(seed).normal(0, 0.3, (12, 3))
    parts = [half(points, axis, 1.0, limit), half(points, axis, -1.0, -limit)]
    volumes = [volume(part) for part in parts if len(part)]
    assert sum(volumes) == pytest.approx(volume(points), rel=1e-6, abs=1e-9)


def test_nothing_is_left_inside_and_no_sliver() -> None:
    assert outside_box(UNIT, np.full(3, -1.0), np.full(3, 2.0)) == []
    assert outside_box(UNIT, np.full(3, -1.0), np.array([2.0, 2.0, 1.0 - 0.5 * THINNEST])) == []
    (whole,) = outside_box(UNIT, np.full(3, 2.0), np.full(3, 3.0))
    assert volume(whole) == pytest.approx(1.0)

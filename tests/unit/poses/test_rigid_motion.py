"""Exponential, logarithm and adjoint against the power series and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.rigid_motion import (
    adjoint,
    angle_of,
    between,
    distance_of,
    exponential,
    fraction,
    logarithm,
    skew,
)

EXAMPLES = settings(deadline=None, max_examples=40)
twists = st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6).map(np.array)


def power_series(twist: np.ndarray) -> np.ndarray:
    """The matrix exponential term by term."""
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = skew(twist[:3]), twist[3:]
    term = total = np.eye(4)
    for k in range(1, 40):
        term = term @ generator / k
        total = total + term
    return total


@EXAMPLES
@given(twists)
def test_exponential_is_the_power_series(twist: np.ndarray) -> None:
    np.testing.assert_allclose(exponential(twist), power_series(twist), atol=1e-9)


@EXAMPLES
@given(twists)
def test_logarithm_undoes_the_exponential(twist: np.ndarray) -> None:
    np.testing.assert_allclose(logarithm(exponential(twist)), twist, atol=1e-7)


@EXAMPLES
@given(twists, twists)
def test_adjoint_moves_a_twist_to_the_other_side(first: np.ndarray, second: np.ndarray) -> None:
    motion = exponential(first)
    expected = motion @ exponential(0.1 * second) @ inverse(motion)
    np.testing.assert_allclose(exponential(adjoint(motion) @ (0.1 * second)), expected, atol=1e-8)


@EXAMPLES
@given(twists)
def test_two_halves_make_the_whole(twist: np.ndarray) -> None:
    motion = exponential(twist)
    half = fraction(motion, 0.5)
    np.testing.assert_allclose(half @ half, motion, atol=1e-7)


def test_a_quarter_screw_by_hand() -> None:
    motion = exponential(np.array([0.0, 0.0, math.pi / 2, 0.0, 0.0, 2.0]))
    np.testing.assert_allclose(motion, [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]], atol=1e-12)
    assert angle_of(motion) == pytest.approx(math.pi / 2)
    assert distance_of(between(motion, np.eye(4))) == pytest.approx(2.0)

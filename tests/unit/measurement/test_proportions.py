"""Intervals of shares against Wilson's formula."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.measurement.proportions import wilson_interval

Z = 1.959963984540054
"""The normal distribution's 97.5 % quantile."""


@pytest.mark.parametrize(("successes", "count"), [(0, 1), (0, 8), (3, 8), (8, 8), (17, 40), (1, 400)])
def test_the_interval_is_that_of_the_closed_form(successes: int, count: int) -> None:
    share = successes / count
    middle = (share + Z**2 / (2 * count)) / (1 + Z**2 / count)
    half = Z * np.sqrt(share * (1 - share) / count + Z**2 / (4 * count**2)) / (1 + Z**2 / count)
    low, high = wilson_interval(successes, count)
    assert (low, high) == pytest.approx((middle - half, middle + half), abs=1e-12)
    assert 0.0 <= low <= share <= high <= 1.0


def test_the_interval_of_failures_is_the_mirror_image() -> None:
    low, high = wilson_interval(3, 10)
    assert wilson_interval(7, 10) == pytest.approx((1 - high, 1 - low), abs=1e-12)


@pytest.mark.parametrize(
    ("successes", "count", "reason"), [(0, 0, "not less than 1"), (3, 2, "greater than"), (-1, 4, "not less than 0")]
)
def test_no_interval_of_nothing(successes: int, count: int, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        wilson_interval(successes, count)

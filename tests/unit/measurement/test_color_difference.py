"""L*a*b* of colours whose values are published, and the CIE 1976 difference."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.evaluate.color_difference import color_difference, lab_from_linear, linear_from_srgb, mean_lab


@pytest.mark.parametrize(
    ("color", "lab"),
    [
        ((255, 255, 255), (100.0, 0.0, 0.0)),
        ((0, 0, 0), (0.0, 0.0, 0.0)),
        ((255, 0, 0), (53.24, 80.09, 67.20)),
        ((0, 0, 255), (32.30, 79.19, -107.86)),
        ((119, 119, 119), (50.03, 0.0, 0.0)),
    ],
)
def test_known_colors(color, lab):
    assert lab_from_linear(linear_from_srgb(np.array(color))) == pytest.approx(np.array(lab), abs=0.02)


def test_differences_and_means():
    white, black = mean_lab(np.array([[255, 255, 255]]), np.ones(1)), mean_lab(np.zeros((1, 3)), np.ones(1))
    assert color_difference(white, black) == pytest.approx(100.0)
    half = mean_lab(np.array([[255, 255, 255], [0, 0, 0]]), np.array([1.0, 1.0]))
    assert half[0] == pytest.approx(116 * 0.5 ** (1 / 3) - 16)  # half the light, not half the number
    with pytest.raises(ValueError, match="no area"):
        mean_lab(np.zeros((1, 3)), np.zeros(1))

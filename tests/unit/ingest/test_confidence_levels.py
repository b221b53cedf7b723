"""Levels of confidence become deviations of depth."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.ingest.confidence_levels import deviation_of_levels


def test_levels_become_metres() -> None:
    levels = np.array([[2, 1, 0], [2, 1, 0]], np.uint8)
    depth = np.array([[0.5, 0.5, 0.5], [4.0, 4.0, 0.0]], np.float32)
    deviation = deviation_of_levels(levels, depth)
    assert deviation.dtype == np.float32
    np.testing.assert_allclose(deviation, [[0.01, 0.03, 0.1], [0.04, 0.12, 0.0]], rtol=1e-6)


@pytest.mark.parametrize("level", [3, 255, -1])
def test_other_levels_are_refused(level: int) -> None:
    with pytest.raises(ValueError, match=r"0\.\.2"):
        deviation_of_levels(np.array([[0, level]]), np.ones((1, 2), np.float32))

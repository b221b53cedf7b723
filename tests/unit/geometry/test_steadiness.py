"""A front that was seen from one side would fall, what has a foot under its middle stands."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.steadiness import LEAST_TILT, stands_steadily


def solid(width: float, depth: float, height: float, lean: float = 0.0) -> np.ndarray:
    """The corners of a box on the floor, its top `lean` to the side."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
    corners = corners * [width, depth, height]
    corners[:, 1] += lean * corners[:, 2] / height
    return corners


@pytest.mark.parametrize(
    ("corners", "expected"),
    [
        (solid(0.8, 0.5, 1.8), True),
        (solid(1.1, 0.06, 0.87), False),  # the front of a counter
        (solid(0.5, 0.5, 1.0, lean=0.6), False),  # its middle is beyond its foot
        (solid(0.5, 0.5, 0.02), True),
        (solid(0.1, 2 * 0.5 * np.tan(LEAST_TILT) * 1.1, 1.0), True),
        (solid(0.1, 2 * 0.5 * np.tan(LEAST_TILT) * 0.9, 1.0), False),
    ],
)
def test_what_would_stand(corners: np.ndarray, expected: bool) -> None:
    assert stands_steadily([corners], 0.0) is expected


def test_a_sheet_has_no_foot() -> None:
    assert not stands_steadily([np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])], 0.0)


def test_pieces_stand_together() -> None:
    """A top of 1 m on two posts stands; on one of them it does not."""
    top, posts = solid(1.0, 0.4, 0.03) + [0, 0, 0.7], [solid(0.04, 0.4, 0.7) + [x, 0, 0] for x in (-0.4, 0.4)]
    assert stands_steadily([top, *posts], 0.0)
    assert not stands_steadily([top, posts[0]], 0.0)

"""Where on a floor there is most room."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.urdf.standing_place import CELL, roomiest_place


def floor(width: float, depth: float) -> np.ndarray:
    x, y = np.meshgrid(np.arange(0.01, width, 0.02), np.arange(0.01, depth, 0.02))
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.01)], axis=1)


def block(low: tuple[float, ...], high: tuple[float, ...]) -> Box:
    return box_from_bounds(np.array(low), np.array(high))


def test_the_middle_of_an_empty_floor():
    middle, radius = roomiest_place(floor(3, 2), [])
    assert middle[1] == pytest.approx(1, abs=CELL) and 1 - CELL <= middle[0] <= 2 + CELL
    assert radius == pytest.approx(1, abs=CELL)


def test_beside_a_cupboard_and_under_a_lamp():
    cupboard, lamp = block((0, 0, 0), (1, 2, 2)), block((1.5, 0.5, 1.9), (2.5, 1.5, 2.2))
    middle, radius = roomiest_place(floor(3, 2), [cupboard, lamp])
    assert middle == pytest.approx([2, 1], abs=CELL) and radius == pytest.approx(1, abs=CELL)


def test_surface_without_a_box_is_in_the_way():
    post = np.stack([np.full(50, 1.5), np.full(50, 1.0), np.linspace(0, 1, 50)], axis=1)
    middle, radius = roomiest_place(floor(3, 2), [], post)
    assert np.linalg.norm(middle - [1.5, 1.0]) >= radius - CELL and radius < 0.95


def test_no_place():
    assert roomiest_place(np.zeros((0, 3)), []) is None
    assert roomiest_place(floor(1, 1), [block((-1, -1, 0), (2, 2, 1))]) is None

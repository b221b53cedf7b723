"""Dishes of unknown size on height maps that are drawn: what is a dish's edge, and what only looks like one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scenewright.stages.tableware.planning.policy import STANDARD_SETTING
from scenewright.stages.tableware.sight import understood
from scenewright.stages.tableware.vision.height_map import TALLEST, HeightMap
from scenewright.stages.tableware.vision.size_estimation import HOLDS, estimated_dishes

ROWS, COLUMNS, FOCAL, ABOVE = 360, 480, 600.0, 0.8
Drawn = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Of x and y (h, w) [m], heights (h, w) [m]; NaN where there is nothing but the table."""


def round_thing(x0: float, y0: float, radius: float, height: float, wall: float = 1.0, floor: float = 0.004) -> Drawn:
    """Return a dish with a wall so thick [m], or, without, a solid cylinder."""

    def draw(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        off = np.hypot(x - x0, y - y0)
        return np.where(off > radius, np.nan, np.where(off > radius - wall, height, floor))

    return draw


def half_of(thing: Drawn) -> Drawn:
    """Return what of a thing lies left of 8 mm before its middle, and its outline."""
    return lambda x, y: np.where((x < -0.008) | (np.hypot(x, y) > 0.036), thing(x, y), np.nan)


def heights_of(*things: Drawn, beyond: float = 1.0) -> HeightMap:
    """Return a map of things, the later ones over the earlier; beyond x [m] the table ends. What is drawn at height z
    is nearer to the middle by a share of z / ABOVE: the camera sees it so."""
    v, u = np.mgrid[0:ROWS, 0:COLUMNS]
    x, y = (u - COLUMNS / 2) / FOCAL * ABOVE, -(v - ROWS / 2) / FOCAL * ABOVE
    heights = np.where(x > beyond, -0.02, 0.0)
    for thing in things:
        drawn = thing(x, y)
        heights = np.where(np.isnan(drawn), heights, drawn)
    tall = heights > TALLEST
    shown = np.where(tall, 0.0, heights).astype(np.float32)
    return HeightMap(
        raw=shown,
        valid=~tall,
        tall=tall,
        smooth=shown,
        color=np.zeros((ROWS, COLUMNS, 3), np.uint8),
        focal=(FOCAL, FOCAL),
        center=(COLUMNS / 2, ROWS / 2),
        camera_height=ABOVE,
        corner=(0, 0),
        sides=(0.6, 0.45),
    )


BOWL = round_thing(0.05, -0.02, 0.075, 0.080, wall=0.008)


@pytest.mark.parametrize("can", [0.045, 0.078, 0.100, 0.130])
def test_a_bowl_with_a_can_in_it_is_a_bowl_that_is_left_alone(can: float) -> None:
    detections = estimated_dishes(heights_of(BOWL, round_thing(0.045, 0.0, 0.026, can)))
    dishes = [one for one in detections if one.kind is not None]
    assert [one.kind for one in dishes] == ["bowl"]
    assert dishes[0].size is not None and dishes[0].size.rim_radius * ABOVE / (ABOVE - 0.08) == pytest.approx(
        0.075, abs=0.003
    )
    if can > 0.080:
        assert HOLDS in dishes[0].unsure and dishes[0].confidence == 0.0
        accepted = understood(detections, 0.5, STANDARD_SETTING)
        assert not accepted.table.items


def test_an_empty_bowl_is_planned_for() -> None:
    (bowl,) = estimated_dishes(heights_of(BOWL))
    assert bowl.kind == "bowl" and HOLDS not in bowl.unsure and bowl.confidence == pytest.approx(0.9)


def test_bowls_that_touch_are_two_and_a_lug_on_a_rim_is_no_cup() -> None:
    other = round_thing(-0.10, -0.02, 0.075, 0.080, wall=0.008)
    lug = round_thing(0.13, -0.02, 0.012, 0.084)
    dishes = [one for one in estimated_dishes(heights_of(other, BOWL, lug)) if one.kind is not None]
    assert [one.kind for one in dishes] == ["bowl", "bowl"]
    assert sorted(one.position[0] for one in dishes) == pytest.approx([-0.09, 0.045], abs=0.003)


@pytest.mark.parametrize(
    ("things", "beyond"),
    [
        ([round_thing(0.0, 0.0, 0.034, 0.10)], 1.0),
        ([round_thing(0.0, 0.0, 0.045, 0.19), round_thing(0.0, 0.0, 0.038, 0.22)], 1.0),
        ([round_thing(0.0, 0.0, 0.045, 0.025, wall=0.012, floor=0.0)], 1.0),
        ([round_thing(0.10, 0.0, 0.030, 0.10), round_thing(0.10, 0.0, 0.030, 0.115, wall=0.003, floor=0.10)], 1.0),
        ([half_of(round_thing(0.0, 0.0, 0.040, 0.07))], -0.008),
    ],
    ids=["can", "taller than heights go", "narrow and flat", "can with a raised edge", "half over the table's edge"],
)
def test_what_is_round_and_no_dish_is_unknown(things: list[Drawn], beyond: float) -> None:
    detections = estimated_dishes(heights_of(*things, beyond=beyond))
    assert detections and all(one.kind is None for one in detections)

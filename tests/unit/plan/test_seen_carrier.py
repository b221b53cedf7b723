"""A tray's shape from the points that two cameras see of it."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.acting.hand.rim_grasps import rim_grasps
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from_yaw
from scenewright.stages.kit.simulation.shapes import link_shapes, surface_points
from scenewright.stages.plan.seen_carrier import SeenCarrier, carrier_text, seen_carrier

LONG, WIDE, RIM, GRIP = 0.24, 0.16, 0.015, 0.047
TRUE = transform_from_yaw(0.3, np.array([1.0, -2.0, 0.75]))


def tray_from_above(random: np.random.Generator) -> np.ndarray:
    """Points (N, 3) of a tray's floor, of the tops of its walls and of the raised grips at its ends, 2 mm of noise."""
    flat = random.uniform(-0.5, 0.5, (16000, 2)) * (LONG, WIDE)
    height = np.full(len(flat), 0.004)
    edge = np.minimum(LONG / 2 - np.abs(flat[:, 0]), WIDE / 2 - np.abs(flat[:, 1]))
    height[edge < 0.006] = RIM
    height[(LONG / 2 - np.abs(flat[:, 0]) < 0.007) & (np.abs(flat[:, 1]) < 0.036)] = GRIP
    return apply(TRUE, np.column_stack([flat, height])) + random.normal(0, 0.002, (len(flat), 3))


def extent(carrier: SeenCarrier) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and greatest corner of its boxes, own frame."""
    low = np.min([center - size / 2 for center, size in carrier.boxes], axis=0)
    return low, np.max([center + size / 2 for center, size in carrier.boxes], axis=0)


def test_a_tray_has_the_size_and_the_rim_that_were_seen() -> None:
    carrier = seen_carrier(tray_from_above(np.random.default_rng(0)), np.zeros((0, 3)), 0.25)
    assert carrier is not None
    low, high = extent(carrier)
    assert high - low == pytest.approx([LONG, WIDE, GRIP], abs=0.009)
    assert carrier.pose[:3, 3] == pytest.approx(TRUE[:3, 3], abs=0.004)
    assert np.arctan2(carrier.pose[1, 0], carrier.pose[0, 0]) == pytest.approx(0.3, abs=0.03)


def test_the_hand_takes_it_by_the_grips_that_it_sees() -> None:
    carrier = seen_carrier(tray_from_above(np.random.default_rng(1)), np.zeros((0, 3)), 0.3)
    assert carrier is not None
    text = carrier_text("tray_1", carrier, 0.2)
    assert max(map(len, text.splitlines())) < 1000  # longer lines pybullet breaks
    shapes = link_shapes(text)["tray_1"]
    points, _ = surface_points(shapes, 3000, np.random.default_rng(0))
    grasps = rim_grasps(points, carrier.pose, np.random.default_rng(0))
    assert grasps
    for grasp in grasps:
        assert abs(abs(grasp.body_from_tool[0, 3]) - LONG / 2) < 0.015  # at its ends, where the grips are


def test_a_tray_is_gripped_by_walls_as_high_as_the_fingers_are_deep() -> None:
    """Its grips look 6 mm lower than they are, so that the strip below their tops takes in the low walls; a grip cut at
    the middle of the tray is no wall across it."""
    points = tray_from_above(np.random.default_rng(0))
    own = apply(inverse(TRUE), points)
    points[own[:, 2] > RIM + 0.01] -= (0.0, 0.0, 0.006)
    carrier = seen_carrier(points, np.zeros((0, 3)), 0.3)
    assert carrier is not None
    for seed in range(5):
        shape, _ = surface_points(
            link_shapes(carrier_text("tray_1", carrier, 0.2))["tray_1"], 3000, np.random.default_rng(seed)
        )
        grasps = rim_grasps(shape, carrier.pose, np.random.default_rng(0))
        assert grasps
        assert all(abs(abs(grasp.body_from_tool[0, 3]) - LONG / 2) < 0.015 for grasp in grasps)


def test_it_is_turned_as_it_was_believed_to_be() -> None:
    carrier = seen_carrier(tray_from_above(np.random.default_rng(0)), np.zeros((0, 3)), 0.3 + np.pi / 2)
    assert carrier is not None
    low, high = extent(carrier)
    assert (high - low)[:2] == pytest.approx([WIDE, LONG], abs=0.009)


def test_what_stands_on_it_is_no_part_of_it() -> None:
    """Pixels at the outline of a can have the can's depth."""
    random = np.random.default_rng(2)
    around = random.uniform(0, 2 * np.pi, 400)
    ring = np.column_stack([0.03 * np.cos(around), 0.03 * np.sin(around), random.uniform(0.02, 0.14, 400)])
    can = apply(TRUE, np.array([0.03, 0.0, 0.0]))
    seen = np.concatenate([tray_from_above(random), apply(TRUE, ring + [0.03, 0.0, 0.0])])
    carrier = seen_carrier(seen, np.array([[*can[:2], 0.03]]), 0.3)
    assert carrier is not None
    assert extent(carrier)[1][2] == pytest.approx(GRIP, abs=0.009)


@pytest.mark.parametrize("count", [0, 60])
def test_too_few_points_say_nothing(count: int) -> None:
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (count, 3))
    assert seen_carrier(points, np.zeros((0, 3)), 0.0) is None

"""The disc of a thing of revolution from a part of its side, and that boxes are none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.graph.observed_box import BoxFit, observed_box
from scenewright.stages.graph.round_footprint import round_footprint
from scenewright.stages.kit.geometry.boxes import box_yaw


def side_of_cylinder(radius: float, seen: float, center: tuple[float, float], noise: float = 0.0, seed: int = 0):
    """Points and normals on `seen` [rad] of a jacket 20 cm tall; `noise` [rad] turns the normals about z."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0.0, seen, 400)
    turned = angle + random.normal(0.0, noise, 400)
    points = np.stack([center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)], axis=1)
    points = np.column_stack([points, random.uniform(0.0, 0.2, 400)])
    return points, np.stack([np.cos(turned), np.sin(turned), np.zeros(400)], axis=1)


@settings(deadline=None, max_examples=30)
@given(
    radius=st.floats(0.02, 0.5),
    seen=st.floats(2.0, 6.28),
    x=st.floats(-3, 3),
    y=st.floats(-3, 3),
    seed=st.integers(0, 9),
)
def test_a_part_of_the_side_tells_the_whole_disc(radius: float, seen: float, x: float, y: float, seed: int) -> None:
    disc = round_footprint(*side_of_cylinder(radius, seen, (x, y), seed=seed))
    assert disc is not None and disc.handle_yaw is None
    assert disc.center == pytest.approx([x, y], abs=1e-6)
    assert disc.radius == pytest.approx(radius, abs=1e-6)


def test_normals_may_be_noisy() -> None:
    disc = round_footprint(*side_of_cylinder(0.035, 3.0, (1.0, 2.0), noise=0.2))
    assert disc is not None
    assert disc.center == pytest.approx([1.0, 2.0], abs=0.005)
    assert disc.radius == pytest.approx(0.035, rel=0.15)


def test_a_narrow_view_says_nothing() -> None:
    assert round_footprint(*side_of_cylinder(0.035, 0.4, (0.0, 0.0))) is None


@pytest.mark.parametrize("width", [0.05, 0.1, 0.15])
def test_two_faces_of_a_box_are_no_disc(width: float) -> None:
    random = np.random.default_rng(0)
    across = random.uniform(0.0, 1.0, (2, 300))
    heights = random.uniform(0.0, 0.2, 600)
    front = np.stack([0.15 * across[0], np.zeros(300)], axis=1)
    side = np.stack([np.zeros(300), width * across[1]], axis=1)
    points = np.column_stack([np.concatenate([front, side]), heights])
    normals = np.repeat([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]], 300, axis=0)
    assert round_footprint(points, normals) is None


def test_tops_are_no_evidence() -> None:
    points, normals = side_of_cylinder(0.1, 6.28, (0.0, 0.0))
    top = np.column_stack([np.random.default_rng(1).uniform(-0.07, 0.07, (1200, 2)), np.full(1200, 0.2)])
    upward = np.tile([0.0, 0.0, 1.0], (1200, 1))
    assert round_footprint(np.concatenate([points, top]), np.concatenate([normals, upward])) is None


def test_a_handle_turns_and_widens_the_box() -> None:
    points, normals = side_of_cylinder(0.04, 6.28, (0.0, 0.0))
    handle = np.random.default_rng(2).uniform([0.055, -0.005, 0.05], [0.075, 0.005, 0.15], (40, 3))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    points = np.concatenate([points, handle]) @ turn.T
    normals = np.concatenate([normals, np.tile([0.0, 0.0, 1.0], (40, 1))]) @ turn.T
    box, _ = observed_box(points, normals, BoxFit(0.05, 0.1, side_share=0.5, may_be_round=True))
    assert box_yaw(box) == pytest.approx(np.pi / 2, abs=0.05)
    assert box.size[:2] == pytest.approx([0.115, 0.08], abs=0.003)
    assert box.center[1] == pytest.approx((0.075 - 0.04) / 2, abs=0.002)


def test_half_a_bottle_gets_the_box_of_the_whole() -> None:
    points, normals = side_of_cylinder(0.035, 2.5, (0.5, 0.5))
    whole, _ = observed_box(points, normals, BoxFit(0.05, 0.1, side_share=0.5, may_be_round=True))
    seen, _ = observed_box(points, normals, BoxFit(0.05, 0.1, side_share=0.5))
    assert whole.size[:2] == pytest.approx([0.07, 0.07], abs=0.001)
    assert min(seen.size[:2]) < 0.06

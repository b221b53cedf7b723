"""True boxes stand along the axes of their model."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.boxes import box_yaw
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.synthesize.truth import object_box


def screen_on_a_round_foot() -> np.ndarray:
    """Corners of a screen 54 x 3 cm and the outline of a foot of 22 cm across below it."""
    angles = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    foot = np.stack([0.11 * np.cos(angles), 0.11 * np.sin(angles), np.zeros(28)], axis=1)
    screen = np.array([[x, y, z] for x in (-0.27, 0.27) for y in (0.0, 0.03) for z in (0.1, 0.4)])
    return np.concatenate([foot, screen])


@pytest.mark.parametrize("yaw", [0.0, 0.3, -1.2, 3.0])
def test_a_monitor_is_as_wide_as_its_screen(yaw: float) -> None:
    pose = transform_from_yaw(yaw, np.array([1.0, 2.0, 0.7]))
    box = object_box(apply(pose, screen_on_a_round_foot()), pose)
    assert box_yaw(box) == pytest.approx(yaw)
    assert box.size == pytest.approx((0.54, 0.22, 0.4), abs=0.002)


def test_a_model_that_lies_across_its_axes_gets_the_least_box() -> None:
    plank = np.array([[-0.5, -0.05, 0], [0.5, -0.05, 0], [0.5, 0.05, 0.1], [-0.5, 0.05, 0.1]])
    across = apply(transform_from_yaw(0.6, np.zeros(3)), plank)
    box = object_box(across, np.eye(4))
    assert sorted(box.size[:2]) == pytest.approx([0.1, 1.0])


def test_a_leaning_model_gets_the_least_box() -> None:
    lean = np.eye(4)
    lean[:3, :3] = [[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]]
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 0.2) for z in (0, 0.1)], dtype=float)
    box = object_box(apply(lean, corners), lean)
    assert box.size == pytest.approx((1.0, 0.8 * 0.2 + 0.6 * 0.1, 0.6 * 0.2 + 0.8 * 0.1))

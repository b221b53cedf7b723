"""The box of what was seen: turned with its sides, blind to a few strays."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.graph.observed_box import BoxFit, observed_box, side_yaw, trimmed_extent
from scenewright.stages.kit.geometry.boxes import box_iou, box_yaw, gravity_aligned_box

TRUE_YAW = 0.3


def side_points(yaw: float, sides: tuple[str, ...], random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points and noisy normals on sides of a box of 0.6 x 0.4 x 0.3 m at the origin."""
    outward = {"front": (0, -1, 0), "right": (1, 0, 0), "top": (0, 0, 1)}
    points, normals = [], []
    for name in sides:
        sample = random.uniform(-0.5, 0.5, (400, 3)) * (0.6, 0.4, 0.3)
        axis = int(np.argmax(np.abs(outward[name])))
        sample[:, axis] = np.sum(outward[name]) * np.array([0.3, 0.2, 0.15])[axis]
        points.append(sample)
        normals.append(np.tile(outward[name], (400, 1)) + random.normal(0, 0.05, (400, 3)))
    rotation = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    turned = np.concatenate(normals) @ rotation.T
    return np.concatenate(points) @ rotation.T, turned / np.linalg.norm(turned, axis=1, keepdims=True)


@pytest.mark.parametrize("yaw", [-0.78, -0.3, 0.0, 0.02, 0.5, 0.785])
def test_the_yaw_is_that_of_the_sides_also_across_the_seam(yaw: float) -> None:
    _, normals = side_points(yaw, ("front", "right"), np.random.default_rng(1))
    found = side_yaw(normals, minimum_share=0.5)
    assert found is not None and -np.pi / 4 <= found < np.pi / 4
    assert abs((found - yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4) < 0.02


def test_round_things_and_flat_things_have_no_sides() -> None:
    angles = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    can = np.stack([np.cos(angles), np.sin(angles), np.zeros(500)], axis=1)
    assert side_yaw(can, minimum_share=0.5) is None
    assert side_yaw(np.tile((0.0, 0.0, 1.0), (500, 1)), minimum_share=0.5) is None


def test_a_corner_of_a_top_does_not_turn_the_box() -> None:
    """A front side and a triangle of the top: the least rectangle follows the triangle, the sides do not."""
    random = np.random.default_rng(2)
    points, normals = side_points(TRUE_YAW, ("front", "top"), random)
    local = points @ np.array([[np.cos(TRUE_YAW), -np.sin(TRUE_YAW)], [np.sin(TRUE_YAW), np.cos(TRUE_YAW)], [0, 0]])
    seen = (np.arange(len(points)) < 400) | (local[:, 0] / 0.6 + local[:, 1] / 0.4 < -0.35)
    box, _ = observed_box(points[seen], normals[seen], BoxFit(0.05, 0.1, trim=0.01, side_share=0.5))
    assert abs((box_yaw(box) - TRUE_YAW + np.pi / 4) % (np.pi / 2) - np.pi / 4) < 0.03


def test_strays_within_reach_of_the_body_are_trimmed() -> None:
    random = np.random.default_rng(3)
    points, normals = side_points(TRUE_YAW, ("front", "right", "top"), random)
    strays = np.array([[0.45, 0.1, 0.1], [-0.42, 0.0, 0.05], [0.0, 0.36, 0.0], [0.0, 0.0, 0.25]])
    cloud = np.concatenate([points, strays])
    directions = np.concatenate([normals, np.tile((0.0, 0.0, 1.0), (4, 1))])
    true = gravity_aligned_box((0, 0, 0), (0.6, 0.4, 0.3), TRUE_YAW)
    trimmed, _ = observed_box(cloud, directions, BoxFit(0.05, 0.2, trim=0.01, side_share=0.5))
    stretched, _ = observed_box(cloud, directions, BoxFit(0.05, 0.2, trim=0.0, side_share=0.5))
    assert box_iou(trimmed, true) > 0.9 > 0.6 > box_iou(stretched, true)


def test_trimmed_extent() -> None:
    values = np.arange(101.0)
    assert trimmed_extent(values, 0.02) == (2.0, 98.0) and trimmed_extent(values, 0.0) == (0.0, 100.0)

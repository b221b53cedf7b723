"""What sticks out of a thing's planned shape is seen, and belongs to it from then on."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.kit.simulation.shapes import link_shapes, surface_points
from scenewright.stages.plan.seen_things import SeenThings
from scenewright.stages.plan.sticking_out import sticking_out
from scenewright.stages.plan.thing_fit import in_sight

EYES = np.array([[0.0, -0.7, 0.8], [0.0, -0.15, 0.5]])
BEAKER = (
    '<robot name="cup_1"><link name="cup_1"><collision><origin xyz="0 0 0.045"/><geometry>'
    '<cylinder radius="0.035" length="0.09"/></geometry></collision></link></robot>'
)


def seen_of_a_mug(pose: np.ndarray) -> np.ndarray:
    """Points (N, 3) of a beaker of that size and its handle, which cameras saw, 1.5 mm of noise."""
    handle = trimesh.creation.box(extents=(0.03, 0.01, 0.05))
    handle.apply_translation((0.048, 0, 0.045))
    random = np.random.default_rng(1)
    points, out = surface_points([*link_shapes(BEAKER)["cup_1"], handle], 9000, random)
    points, out = apply(pose, points), out @ pose[:3, :3].T
    shown = np.any([in_sight(points, out, eye) for eye in EYES], axis=0)
    return points[shown] + random.normal(0, 0.0015, (int(shown.sum()), 3))


def surface(text: str) -> np.ndarray:
    """Points around what URDF text says."""
    return surface_points(link_shapes(text)["cup_1"], 6000, np.random.default_rng(0))[0]


def test_a_handle_that_the_map_lost_is_believed_where_it_was_seen() -> None:
    truth = transform_from_yaw(-1.6, np.array([0.02, 0.03, 0.7]))
    things = SeenThings()
    pose, text = things.fitted(
        "cup_1", BEAKER, transform_from_yaw(0.0, np.array([0, 0, 0.7])), seen_of_a_mug(truth), EYES
    )
    points = apply(pose, surface(text))
    tip = apply(truth, np.array([[0.063, 0.0, 0.045]]))[0]
    assert np.linalg.norm(points - tip, axis=1).min() < 0.012
    assert points.min(axis=0)[:2] + points.max(axis=0)[:2] == pytest.approx(2 * pose[:2, 3], abs=0.01)
    again, text = things.fitted("cup_1", text, pose, seen_of_a_mug(truth), EYES)
    assert np.linalg.norm(again[:3, 3] - pose[:3, 3]) < 0.01
    assert len(link_shapes(text)["cup_1"]) > 1


def test_nothing_sticks_out_of_what_looks_as_planned() -> None:
    points, _ = surface_points(link_shapes(BEAKER)["cup_1"], 3000, np.random.default_rng(0))
    noisy = points + np.random.default_rng(2).normal(0, 0.002, points.shape)
    assert sticking_out(noisy, points) == []
    pose, text = SeenThings().fitted("cup_1", BEAKER, np.eye(4), noisy[noisy[:, 2] > 0.01], EYES)
    assert len(link_shapes(text)["cup_1"]) == 1
    assert pose[:2, 3] == pytest.approx([0, 0], abs=0.003)

"""The rig's projection against its own triangulation, and the needle's frame."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.suture.rig import ENDOSCOPE, TWO_CAMERAS, NeedlePose

from tests.unit.suture.needle_cases import pose_at


@pytest.mark.parametrize("rig", [TWO_CAMERAS, ENDOSCOPE])
def test_triangulation_undoes_projection(rig):
    points = np.random.default_rng(0).uniform([-0.03, -0.03, 0.1], [0.03, 0.03, 0.4], (50, 3))
    left, right = rig.left(points), rig.right(points)
    assert np.allclose(left[:, 1], right[:, 1])
    assert np.allclose(rig.triangulate(left, left[:, 0] - right[:, 0]), points, atol=1e-12)


def test_what_is_behind_or_without_disparity_is_nan():
    assert np.isnan(TWO_CAMERAS.left(np.array([[0.0, 0.0, -0.1]]))).all()
    assert np.isnan(TWO_CAMERAS.triangulate(np.zeros((2, 2)), np.array([0.0, np.nan]))).all()


def test_the_arc_runs_from_tip_to_swage_about_the_normal():
    pose = pose_at()
    assert np.linalg.norm(pose.tip - pose.swage) == pytest.approx(0.024)
    middle = pose.points(np.array([np.pi / 2]))[0]
    assert np.cross(pose.tip - pose.centre, middle - pose.centre) @ pose.normal > 0


def test_exchanging_the_ends_keeps_the_arc():
    pose = pose_at()
    swapped = pose.swapped()
    assert np.allclose(swapped.tip, pose.swage)
    assert np.allclose(swapped.points(np.array([1.0])), pose.points(np.array([np.pi - 1.0])))
    assert np.linalg.det(swapped.camera_from_needle[:3, :3]) == pytest.approx(1.0)


def test_degrees_from_edge_on():
    matrix = np.eye(4)
    matrix[2, 3] = 0.3
    assert NeedlePose(matrix).degrees_from_edge_on() == pytest.approx(90.0)
    matrix[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    assert NeedlePose(matrix).degrees_from_edge_on() == pytest.approx(0.0, abs=1e-6)

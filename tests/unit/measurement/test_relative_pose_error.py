"""Relative pose error of paths whose drift is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.measurement.relative_pose_error import relative_error, trajectory_drift
from scipy.spatial.transform import Rotation

TIMES = 0.1 * np.arange(101)


def straight(stretch: float = 1.0, turn: float = 0.0) -> np.ndarray:
    """10 s along x at 0.5 m/s times `stretch`, turning about x by `turn` rad/s."""
    return np.array(
        [
            transform_from(Rotation.from_euler("x", turn * t).as_matrix(), np.array([0.5 * stretch * t, 0.0, 0.0]))
            for t in TIMES
        ]
    )


def test_a_path_that_is_two_percent_too_long() -> None:
    drift = trajectory_drift(TIMES, straight(), TIMES, straight(1.02))
    assert drift.per_second is not None and drift.per_metre is not None
    assert drift.per_second.translation_rmse == pytest.approx(0.01)
    assert drift.per_metre.translation_rmse == pytest.approx(0.02)
    assert drift.per_second.rotation_mean == pytest.approx(0.0, abs=1e-6)
    assert drift.per_second.pairs == 91


def test_a_path_that_turns() -> None:
    drift = trajectory_drift(TIMES, straight(), TIMES, straight(turn=math.radians(1)))
    assert drift.per_second is not None and drift.per_metre is not None
    assert drift.per_second.rotation_mean == pytest.approx(math.radians(1), rel=1e-6)
    assert drift.per_metre.rotation_mean == pytest.approx(math.radians(2), rel=1e-6)


def test_where_the_world_lies_does_not_matter() -> None:
    elsewhere = transform_from(Rotation.from_euler("xyz", [0.3, 1.0, -2.0]).as_matrix(), np.array([4.0, 5.0, 6.0]))
    drift = trajectory_drift(TIMES, straight(), TIMES, elsewhere @ straight())
    assert drift.per_second is not None and drift.per_second.translation_rmse < 1e-9


def test_gaps_are_not_bridged() -> None:
    places = np.array([0.0, 0.5, 5.0, 5.5])
    poses = straight()[:4]
    assert relative_error(poses, poses, places, 1.0, 0.5) is None
    found = relative_error(poses, poses, places, 0.5, 0.1)
    assert found is not None and found.pairs == 2


def test_one_pose_has_no_drift() -> None:
    assert trajectory_drift(TIMES[:1], straight()[:1], TIMES[:1], straight()[:1]).per_second is None

"""Trajectories: round trips, and garbage that is refused as bad input and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenewright.stages.kit.formats.trajectories import read_open3d_log, read_tum, write_open3d_log, write_tum
from scipy.spatial.transform import Rotation

FILES = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def trajectories(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    count = draw(st.integers(0, 6))
    seed = draw(st.integers(0, 2**31))
    random = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    if count:
        poses[:, :3, :3] = Rotation.random(count, random_state=seed).as_matrix()
        poses[:, :3, 3] = random.uniform(-100, 100, (count, 3))
    gaps = draw(st.lists(st.floats(1e-3, 1e3), min_size=count, max_size=count))
    return np.cumsum(gaps), poses


@FILES
@given(trajectories())
def test_tum_round_trip(tmp_path: Path, trajectory: tuple[np.ndarray, np.ndarray]) -> None:
    times, poses = trajectory
    write_tum(tmp_path / "t.tum", times, poses)
    read_times, read_poses = read_tum(tmp_path / "t.tum")
    np.testing.assert_allclose(read_times, times, atol=1e-9)
    np.testing.assert_allclose(read_poses, poses, atol=2e-9)


@FILES
@given(trajectories())
def test_open3d_log_round_trip_is_exact(tmp_path: Path, trajectory: tuple[np.ndarray, np.ndarray]) -> None:
    write_open3d_log(tmp_path / "t.log", trajectory[1])
    read = read_open3d_log(tmp_path / "t.log")
    assert len(read) == len(trajectory[1])
    for expected, pose in zip(trajectory[1], read, strict=True):
        np.testing.assert_array_equal(pose, expected)


def test_tum_columns_are_time_translation_quaternion_xyzw(tmp_path: Path) -> None:
    path = tmp_path / "t.tum"
    path.write_text("# comment\n\n1.5 1 2 3 0 0 0.70710678 0.70710678\n")
    times, poses = read_tum(path)
    assert times.tolist() == [1.5]
    np.testing.assert_allclose(poses[0], [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-7)


def test_writer_refuses_a_mirrored_pose(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not rigid"):
        write_tum(tmp_path / "t", np.array([0.0]), np.diag([1.0, 1.0, -1.0, 1.0])[None])

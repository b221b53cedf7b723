"""Kinematics of the patient-side manipulator against second implementations."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.suture.robot import psm
from scenewright.stages.suture.robot.inverse import branches, follow, reachable, solutions
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

RANDOM = np.random.default_rng(3)


def by_exponentials(joints: np.ndarray) -> np.ndarray:
    """The same arm as screws about axes at rest, read off a drawing: no table of link rows is used."""
    tool = psm.TOOL_LENGTH - psm.REMOTE_CENTRE_TO_CARRIAGE
    pitch, yaw = np.array([0, 0, -tool]), np.array([0, 0, -tool - psm.PITCH_TO_YAW])
    screws = [
        ([0, -1, 0], [0, 0, 0]),
        ([-1, 0, 0], [0, 0, 0]),
        (None, [0, 0, -1]),
        ([0, 0, -1], [0, 0, 0]),
        ([-1, 0, 0], pitch),
        ([0, -1, 0], yaw),
    ]
    pose = np.eye(4)
    for (axis, point), value in zip(screws, joints, strict=True):
        step = np.eye(4)
        if axis is None:
            step[:3, 3] = value * np.asarray(point, dtype=float)
        else:
            step[:3, :3] = Rotation.from_rotvec(value * np.asarray(axis, dtype=float)).as_matrix()
            step[:3, 3] = np.asarray(point) - step[:3, :3] @ np.asarray(point)
        pose = pose @ step
    rest = np.eye(4)
    rest[:3, :3] = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    rest[:3, 3] = yaw + [0, 0, -psm.YAW_TO_TIP]
    return pose @ rest


def random_joints(count: int) -> np.ndarray:
    low, high = psm.LOWER.copy(), psm.UPPER.copy()
    low[2] = 0.05
    return RANDOM.uniform(low, high, size=(count, 6))


def test_forward_agrees_with_screws() -> None:
    for joints in random_joints(50):
        assert np.allclose(psm.forward(joints), by_exponentials(joints), atol=1e-12)


def test_every_branch_reaches_the_pose_and_the_true_joints_are_one_of_them() -> None:
    for joints in random_joints(100):
        pose = psm.forward(joints)
        rows = branches(pose)
        assert rows.shape == (8, 6)
        assert np.allclose(psm.forward(rows), pose, atol=1e-9)
        assert len(np.unique(np.round(rows, 6), axis=0)) == 8
        assert np.abs(solutions(pose) - joints).max(axis=1).min() < 1e-7
        assert reachable(pose)


def test_a_numerical_search_finds_no_other_branch() -> None:
    joints = random_joints(1)[0]
    pose = psm.forward(joints)
    known = branches(pose)

    def residual(x: np.ndarray) -> np.ndarray:
        found = psm.forward(x)
        return np.concatenate([(found[:3, 3] - pose[:3, 3]) * 20, (found[:3, :3] - pose[:3, :3]).ravel()])

    solved = 0
    for start in random_joints(25):
        result = least_squares(residual, start)
        if result.cost < 1e-16:
            solved += 1
            apart = result.x - known
            apart[:, [0, 1, 3, 4, 5]] = (apart[:, [0, 1, 3, 4, 5]] + np.pi) % (2 * np.pi) - np.pi
            assert np.abs(apart).max(axis=1).min() < 1e-4
    assert solved >= 5


def test_jacobian_is_the_derivative() -> None:
    for joints in random_joints(20):
        expected = np.zeros((6, 6))
        for k in range(6):
            step = np.eye(6)[k] * 1e-6
            before, after = by_exponentials(joints - step), by_exponentials(joints + step)
            expected[:3, k] = (after[:3, 3] - before[:3, 3]) / 2e-6
            expected[3:, k] = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec() / 2e-6
        assert np.allclose(psm.jacobian(joints), expected, atol=1e-6)


def test_a_pose_beyond_the_insertion_has_no_solution() -> None:
    pose = psm.forward(np.array([0.1, 0.1, 0.2, 0.0, 0.1, 0.1]))
    pose[:3, 3] *= 2.0
    assert len(solutions(pose)) == 0
    assert not reachable(pose)
    assert follow(pose[None], np.zeros(6)) is None


def test_following_a_path_stays_on_one_branch() -> None:
    start = np.array([0.2, -0.1, 0.15, 3.0, 0.3, -0.2])
    ends = start + np.array([0.1, 0.1, 0.02, 0.8, 0.2, 0.2])
    path = np.linspace(start, ends, 30)
    found = follow(psm.forward(path), start)
    assert found is not None
    assert np.allclose(found, path, atol=1e-8)


@pytest.mark.parametrize("joint", range(6))
def test_limits(joint: int) -> None:
    inside = (psm.LOWER + psm.UPPER) / 2
    assert psm.within_limits(inside)
    inside[joint] = psm.UPPER[joint] + 1e-3
    assert not psm.within_limits(inside)

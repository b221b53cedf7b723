"""Inverse kinematics against forward kinematics, and both against pybullet."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.motion.cartesian import follow, straight_poses
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import arm_chain, forward, inverse_kinematics, random_starts, reach
from scenewright.stages.kit.simulation.robot import Configuration, base_pose
from scenewright.stages.kit.simulation.robot_description import load_robot

PANDA = load_robot("panda")
CHAIN = arm_chain(PANDA)


def test_forward_kinematics_agrees_with_pybullet(checker: CollisionChecker) -> None:
    random = np.random.default_rng(0)
    for arm in random_starts(CHAIN, 20, random):
        base = random.uniform(-1, 1, 3)
        checker.robot.set(Configuration(base, arm, 0.04))
        expected = checker.robot.tool_pose()
        np.testing.assert_allclose(base_pose(base, PANDA) @ forward(CHAIN, arm), expected, atol=2e-6)


def test_inverse_kinematics_reaches_what_forward_kinematics_gives() -> None:
    random = np.random.default_rng(1)
    found = 0
    for arm in random_starts(CHAIN, 150, random):
        target = forward(CHAIN, arm)
        solution = inverse_kinematics(CHAIN, target, random_starts(CHAIN, 16, random))
        found += solution.found
        if solution.found:
            reached = forward(CHAIN, solution.arm)
            assert np.linalg.norm(reached[:3, 3] - target[:3, 3]) < 2e-4
            assert np.arccos(np.clip((np.trace(reached[:3, :3].T @ target[:3, :3]) - 1) / 2, -1, 1)) < 2e-3
            assert np.all(solution.arm >= CHAIN.lower) and np.all(solution.arm <= CHAIN.upper)
    assert found >= 145


def test_a_pose_out_of_reach_is_not_found_and_its_distance_is_told() -> None:
    target = transform_from(np.diag([1.0, -1.0, -1.0]), np.array([1.6, 0.0, 0.4]))
    starts = random_starts(CHAIN, 12, np.random.default_rng(2))
    solution = inverse_kinematics(CHAIN, target, starts)
    assert not solution.found
    assert 0.4 < solution.position_error < 1.2
    assert np.linalg.norm(forward(CHAIN, solution.arm)[:3, 3] - target[:3, 3]) == pytest.approx(solution.position_error)


def test_no_configuration_is_farther_than_the_reach() -> None:
    arms = random_starts(CHAIN, 300, np.random.default_rng(3))
    distances = [np.linalg.norm(forward(CHAIN, arm)[:3, 3] - [0, 0, 0.333]) for arm in arms]
    assert max(distances) < reach(CHAIN)


def test_the_tool_follows_a_straight_line() -> None:
    start = forward(CHAIN, PANDA.carry)
    end = start.copy()
    end[:3, 3] += [0.12, 0.05, -0.04]
    arms = follow(CHAIN, straight_poses(start, end), PANDA.carry)
    positions = np.array([forward(CHAIN, arm)[:3, 3] for arm in arms])
    direction = (end - start)[:3, 3] / np.linalg.norm((end - start)[:3, 3])
    off = positions - start[:3, 3]
    off -= np.outer(off @ direction, direction)
    assert np.abs(off).max() < 3e-4
    np.testing.assert_allclose(positions[-1], end[:3, 3], atol=3e-4)


def test_a_line_that_leaves_the_workspace_is_refused_with_the_point() -> None:
    start = forward(CHAIN, PANDA.carry)
    end = start.copy()
    end[0, 3] += 1.5
    with pytest.raises(MotionFailed) as raised:
        follow(CHAIN, straight_poses(start, end), PANDA.carry)
    failure = raised.value.failure
    assert failure.kind == "no_inverse_kinematics"
    assert 1 < failure.numbers["point"] < failure.numbers["points"]

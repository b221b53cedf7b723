"""The motion problem interface: goals of every kind, planners, attachments, typed failures with numbers."""

from __future__ import annotations

import numpy as np
import pytest

from stages.kit.motion.all_branches import all_solutions, panda_lengths, unlimited_solutions
from stages.kit.motion.base_placement import base_query, in_arm_frame
from stages.kit.motion.collision import CollisionChecker
from stages.kit.motion.failures import MotionFailed
from stages.kit.motion.kinematics import arm_chain, forward
from stages.kit.motion.path_query import Effort
from stages.kit.motion.path_search import find_path
from stages.kit.motion.problem import ArmGoal, Attachment, BaseGoal, MotionProblem, Planner, ToolGoal, solve
from stages.kit.motion.rrt_connect import densify
from stages.kit.simulation.robot import base_pose
from stages.kit.simulation.robot_description import load_robot
from tests.unit.motion.test_paths import ROOM

PANDA = load_robot("panda")
CHAIN = arm_chain(PANDA)
HOME = np.concatenate([[0.0, 0.0, 0.0], PANDA.carry])
REACHING = np.array([0.8, 0.5, 0.2, -1.4, 0.1, 2.0, 0.5])
FINE = np.concatenate([np.full(2, 0.02), [0.04], np.full(7, 0.02)])


def _kinds(problem: MotionProblem, checker: CollisionChecker) -> MotionFailed:
    with pytest.raises(MotionFailed) as raised:
        solve(problem, checker, np.random.default_rng(0))
    return raised.value


def test_every_branch_is_found_and_reaches() -> None:
    random = np.random.default_rng(0)
    assert panda_lengths(CHAIN) == pytest.approx([0.333, 0.316, 0.0825, 0.384, 0.088])
    for _ in range(8):
        arm = random.uniform(CHAIN.lower, CHAIN.upper)
        target = forward(CHAIN, arm)
        found = all_solutions(CHAIN, target, random)
        for other in found:
            np.testing.assert_allclose(forward(CHAIN, other), target, atol=1e-6)
        assert np.all(found >= CHAIN.lower)
        assert np.all(found <= CHAIN.upper)
        # The grid over the last joint passes near the values that were drawn.
        nearest = np.abs(found[:, 6] - arm[6]).min()
        assert nearest <= (CHAIN.upper[6] - CHAIN.lower[6]) / 94 + 1e-9
        assert len(unlimited_solutions(CHAIN, target)) >= len(found)


@pytest.mark.parametrize("planner", ["rrt_connect", "bit_star"])
def test_an_arm_goal_by_both_planners(checker: CollisionChecker, planner: Planner) -> None:
    problem = MotionProblem(HOME, ArmGoal(REACHING), planner=planner, samples=1000)
    first, second = (solve(problem, checker, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.path, second.path)
    np.testing.assert_allclose(first.path[0], HOME)
    np.testing.assert_allclose(first.path[-1, 3:], REACHING)
    assert all(checker.check_meshes(row) is None for row in densify(first.path, FINE))
    assert first.effort.mesh_checks > 0


def test_a_tool_goal_ends_at_the_pose(checker: CollisionChecker) -> None:
    target = base_pose(HOME[:3], PANDA) @ forward(CHAIN, REACHING)
    result = solve(MotionProblem(HOME, ToolGoal(target)), checker, np.random.default_rng(0))
    reached = forward(CHAIN, result.path[-1, 3:])
    np.testing.assert_allclose(reached, in_arm_frame(HOME[:3], target, PANDA), atol=1e-3)


def test_a_base_goal_while_something_is_held(checker: CollisionChecker) -> None:
    start = np.concatenate([[-1.3, 0.0, 0.0], PANDA.carry])
    held = np.eye(4)
    held[:3, 3] = [0.0, 0.0, 0.03]
    before = checker.world.pose("bottle_7")
    goal = BaseGoal(np.array([-1.3, -2.0, 1.0]), ROOM)
    problem = MotionProblem(start, goal, attachment=Attachment("bottle_7", held), touch=frozenset({"bottle_7"}))
    result = solve(problem, checker, np.random.default_rng(0))
    assert np.ptp(result.path[:, 3:], axis=0).max() == 0.0
    np.testing.assert_allclose(result.path[-1, :2], [-1.3, -2.0])
    assert checker.carried is None
    np.testing.assert_allclose(checker.world.pose("bottle_7"), before, atol=1e-6)


def test_failures_have_kinds_and_numbers(checker: CollisionChecker) -> None:
    far = np.eye(4)
    far[:3, :3] = np.diag([1.0, -1.0, -1.0])
    far[:3, 3] = [2.0, 0.0, 1.0]
    failure = _kinds(MotionProblem(HOME, ToolGoal(far)), checker).failure
    assert failure.kind == "no_inverse_kinematics"
    nearest = np.array([failure.numbers[f"nearest_{axis}"] for axis in "xyz"])
    assert np.linalg.norm(nearest - far[:3, 3]) == pytest.approx(failure.numbers["distance"], abs=1e-4)
    assert failure.numbers["distance"] > 0.9

    beyond = REACHING.copy()
    beyond[3] = 0.1
    failure = _kinds(MotionProblem(HOME, ArmGoal(beyond)), checker).failure
    assert (failure.kind, failure.numbers["joint"]) == ("joint_limit", 3)
    assert failure.numbers["outside"] == pytest.approx(0.1698)

    in_door = np.concatenate([[0.69, 0.9, 0.0], PANDA.carry])
    failure = _kinds(MotionProblem(in_door, ArmGoal(REACHING)), checker).failure
    assert failure.kind == "start_in_collision"
    assert failure.objects[-1].startswith("fridge_2")
    assert failure.numbers["depth"] > 0.05

    into_pedestal = np.array([0.0, -1.7, 0.0, -3.05, 0.0, 1.0, 0.0])
    failure = _kinds(MotionProblem(HOME, ArmGoal(into_pedestal)), checker).failure
    assert failure.kind == "goal_in_collision"
    assert failure.numbers["depth"] > 0

    around = np.concatenate([[-1.3, 0.0, 0.0], PANDA.carry])
    goal = BaseGoal(np.array([-1.3, -2.0, 1.0]), ROOM)
    failure = _kinds(MotionProblem(around, goal, samples=1), checker).failure
    assert failure.kind == "no_path"
    assert failure.objects == ("table_3",)
    assert failure.numbers["samples"] == 1


def test_what_an_earlier_search_took_is_no_part_of_the_budget(checker: CollisionChecker) -> None:
    query = base_query(np.array([-1.3, 0.0, 0.0]), np.array([-1.3, -2.0, 1.0]), PANDA.carry, ROOM)
    fresh, used = Effort(), Effort(samples=5000, rejected=9)
    paths = [find_path(query, checker, np.random.default_rng(0), samples=500, effort=entry) for entry in (fresh, used)]
    np.testing.assert_array_equal(*paths)
    assert (used.samples, used.rejected) == (5000 + fresh.samples, 9)
    assert 0 < fresh.samples < 500
    assert not used.by_meshes

"""RRT-Connect, collision checks and their typed failures."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.acting.query import carrying
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.base_placement import base_query, plan_drive, sample_bases
from scenewright.stages.kit.motion.collision import Collision, CollisionChecker
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import arm_chain
from scenewright.stages.kit.motion.path_query import Effort, Query
from scenewright.stages.kit.motion.path_search import find_path
from scenewright.stages.kit.motion.rrt_connect import SearchSpace, densify, first_collision, rrt_connect
from scenewright.stages.kit.motion.timing import sample_times, time_path
from scenewright.stages.kit.simulation.robot_description import load_robot

PANDA = load_robot("panda")
CHAIN = arm_chain(PANDA)
ARM = SearchSpace(CHAIN.lower, CHAIN.upper, np.full(7, 0.05))
HOME = np.concatenate([[0.0, 0.0, 0.0], PANDA.carry])
REACHING = np.array([0.8, 0.5, 0.2, -1.4, 0.1, 2.0, 0.5])
SQUARE = SearchSpace(np.zeros(2), np.ones(2), np.full(2, 0.01))
ROOM = (np.array([-2.5, -2.5]), np.array([2.5, 2.5]))


def wall_with_gap(point: np.ndarray) -> Collision | None:
    """A wall at x = 0.5 with a gap at y > 0.85."""
    if abs(point[0] - 0.5) < 0.05 and point[1] < 0.85:
        return Collision("point", "wall_1", 0.05 - abs(point[0] - 0.5))
    return None


def closed_wall(point: np.ndarray) -> Collision | None:
    return Collision("point", "wall_1", 0.01) if abs(point[0] - 0.5) < 0.05 else None


def test_rrt_goes_around_a_wall_and_every_point_is_free() -> None:
    start, goal = np.array([0.1, 0.1]), np.array([0.9, 0.1])
    path = rrt_connect(start, goal, wall_with_gap, SQUARE, np.random.default_rng(0))
    np.testing.assert_array_equal(path[0], start)
    np.testing.assert_array_equal(path[-1], goal)
    assert first_collision(densify(path, np.full(2, 0.003)), wall_with_gap) is None
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert length < 2.6  # the shortest way is about 1.8; smoothing must have worked


def test_rrt_is_the_same_for_the_same_seed_whatever_was_searched_before() -> None:
    def path(seed: int) -> np.ndarray:
        start, goal = np.array([0.1, 0.1]), np.array([0.9, 0.1])
        return rrt_connect(start, goal, wall_with_gap, SQUARE, np.random.default_rng(seed))

    first = path(5)
    assert not np.array_equal(path(6), first)
    np.testing.assert_array_equal(path(5), first)


def test_what_the_check_raises_leaves_the_search() -> None:
    class Stop(Exception):
        pass

    left = iter(range(60))

    def check(point: np.ndarray) -> Collision | None:
        if next(left, None) is None:
            raise Stop
        return wall_with_gap(point)

    with pytest.raises(Stop):
        rrt_connect(np.array([0.1, 0.1]), np.array([0.9, 0.1]), check, SQUARE, np.random.default_rng(0))


def test_typed_failures() -> None:
    random = np.random.default_rng(0)
    with pytest.raises(MotionFailed) as raised:
        rrt_connect(np.array([0.1, 0.1]), np.array([0.9, 0.1]), closed_wall, SQUARE, random, samples=50)
    failure = raised.value.failure
    assert (failure.kind, failure.objects, failure.numbers["samples"]) == ("no_path", ("wall_1",), 50)
    with pytest.raises(MotionFailed) as raised:
        rrt_connect(np.array([0.5, 0.1]), np.array([0.9, 0.1]), wall_with_gap, SQUARE, random)
    failure = raised.value.failure
    assert failure.kind == "start_in_collision"
    assert failure.objects == ("point", "wall_1")
    assert failure.numbers["depth"] == pytest.approx(0.05)
    with pytest.raises(MotionFailed) as raised:
        rrt_connect(np.array([0.1, 0.1]), np.array([0.5, 0.1]), wall_with_gap, SQUARE, random)
    assert raised.value.failure.kind == "goal_in_collision"
    with pytest.raises(MotionFailed) as raised:
        rrt_connect(np.array([0.1, 0.1]), np.array([0.5, 1.2]), wall_with_gap, SQUARE, random)
    failure = raised.value.failure
    assert failure.kind == "joint_limit"
    assert failure.numbers["outside"] == pytest.approx(0.2)


def arm_query(goal: np.ndarray, start: np.ndarray = HOME) -> Query:
    return Query(start, np.arange(3, 10), start[3:], goal[None], ARM)


def test_an_arm_query_ends_free_at_its_goal(checker: CollisionChecker) -> None:
    query, effort = arm_query(REACHING), Effort()
    first = find_path(query, checker, np.random.default_rng(3), effort=effort)
    np.testing.assert_array_equal(find_path(query, checker, np.random.default_rng(3)), first)
    np.testing.assert_array_equal(first[[0, -1]], [PANDA.carry, REACHING])
    assert all(checker.check_meshes(query.whole(row)) is None for row in densify(first, np.full(7, 0.02)))
    assert effort.mesh_checks > 0


def test_failures_of_a_query_have_kinds_and_numbers(checker: CollisionChecker) -> None:
    def failure(query: Query, samples: int = 2000):  # type: ignore[no-untyped-def]
        with pytest.raises(MotionFailed) as raised:
            find_path(query, checker, np.random.default_rng(0), samples=samples)
        return raised.value.failure

    beyond = REACHING.copy()
    beyond[3] = 0.1
    found = failure(arm_query(beyond))
    assert (found.kind, found.numbers["joint"]) == ("joint_limit", 3)
    assert found.numbers["outside"] == pytest.approx(0.1698)

    found = failure(arm_query(REACHING, np.concatenate([[0.69, 0.9, 0.0], PANDA.carry])))
    assert found.kind == "start_in_collision"
    assert found.objects[-1].startswith("fridge_2")
    assert found.numbers["depth"] > 0.05

    found = failure(arm_query(np.array([0.0, -1.7, 0.0, -3.05, 0.0, 1.0, 0.0])))
    assert found.kind == "goal_in_collision"
    assert found.numbers["depth"] > 0

    drive = base_query(np.array([-1.3, 0.0, 0.0]), np.array([-1.3, -2.0, 1.0]), PANDA.carry, ROOM)
    found = failure(drive, samples=1)
    assert (found.kind, found.objects, found.numbers["samples"]) == ("no_path", ("table_3",), 1)


def test_what_an_earlier_search_took_is_no_part_of_the_budget(checker: CollisionChecker) -> None:
    query = base_query(np.array([-1.3, 0.0, 0.0]), np.array([-1.3, -2.0, 1.0]), PANDA.carry, ROOM)
    fresh, used = Effort(), Effort(samples=5000, rejected=9)
    paths = [find_path(query, checker, np.random.default_rng(0), samples=500, effort=entry) for entry in (fresh, used)]
    np.testing.assert_array_equal(*paths)
    assert (used.samples, used.rejected) == (5000 + fresh.samples, 9)
    assert 0 < fresh.samples < 500
    assert not used.by_meshes


def test_the_checker_names_what_is_hit(checker: CollisionChecker) -> None:
    assert checker.check(np.concatenate([[0.0, 0.0, 0.0], PANDA.carry])) is None
    at_table_leg = checker.check(np.concatenate([[-1.85, -0.7, 0.0], PANDA.carry]))
    assert at_table_leg is not None
    assert at_table_leg.other == "table_3"
    in_door = checker.check(np.concatenate([[0.69, 0.9, 0.0], PANDA.carry]))
    assert in_door is not None
    assert in_door.other == "fridge_2__door"
    assert in_door.depth > 0.05


def test_the_arm_does_not_go_through_itself(checker: CollisionChecker) -> None:
    into_pedestal = np.array([0.0, -1.7, 0.0, -3.05, 0.0, 1.0, 0.0])
    hit = checker.check(np.concatenate([[0.0, 0.0, 0.0], into_pedestal]))
    assert hit is not None
    links = set(checker.robot.links)
    assert {hit.part, hit.other} <= links


def test_what_is_carried_collides_too(checker: CollisionChecker) -> None:
    body = np.concatenate([[-1.3, -0.2, -np.pi / 2], PANDA.carry])
    checker.robot.set_body(body)
    assert checker.check(body) is None
    home = checker.world.pose("bottle_7")
    low = np.eye(4)
    low[:3, 3] = [0.0, 0.0, 0.25]  # a bottle stuck out along the approach, down into the table
    collision = checker.under(carrying("bottle_7", low)).check(body)
    assert collision is not None
    assert (collision.part, collision.other) == ("bottle_7", "table_3")
    resting = carrying("bottle_7", low, rests_on={"table_3": 1.0, "cup_5": 1.0})
    assert checker.under(resting).check(body) is None
    assert checker.check(body) is None, "the checker itself carries nothing"
    np.testing.assert_array_equal(checker.world.pose("bottle_7"), home)


def test_driving_around_the_furniture(checker: CollisionChecker) -> None:
    start, goal = np.array([-1.3, 0.0, 0.0]), np.array([-1.3, -2.0, 1.0])
    path = plan_drive(start, goal, PANDA.carry, checker, ROOM, np.random.default_rng(0))
    dense = densify(path, np.array([0.02, 0.02, 0.04]))
    found = first_collision(dense, lambda base: checker.check(np.concatenate([base, PANDA.carry])))
    assert found is None
    assert np.allclose(path[-1][:2], goal[:2])
    assert np.cos(path[-1][2] - goal[2]) == pytest.approx(1.0)


def test_bases_face_their_target_within_the_room() -> None:
    bases = sample_bases(np.array([2.0, 0.0]), ROOM, 300, np.random.default_rng(0), heading=0.5)
    assert 50 < len(bases) < 300
    assert bases[:, 0].max() < 2.5
    toward = np.arctan2(-bases[:, 1], 2.0 - bases[:, 0])
    assert np.abs(np.angle(np.exp(1j * (bases[:, 2] - toward)))).max() <= 0.5 + 1e-9


def test_times_keep_the_speed_and_acceleration_limits() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    speed, acceleration = np.array([0.5, 0.25]), np.array([1.0, 1.0])
    times, points = time_path(path, speed, acceleration)
    assert np.all(np.diff(times) > 0)
    rows = sample_times(times, points, 0.01)
    velocity = np.diff(rows, axis=0) / 0.01
    assert np.abs(velocity[:-1]).max(axis=0) == pytest.approx(speed, rel=0.05)
    np.testing.assert_array_equal(rows[-1], path[-1])
    assert times[-1] > 1.0 / 0.5 + 1.0 / 0.25
    assert np.abs(velocity[0]).max() < 0.1  # it starts from rest


def test_speed_does_not_jump_between_samples() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.3], [1.0, 1.0]])
    times, points = time_path(path, np.array([0.5, 0.25]), np.array([1.0, 1.0]))
    rows = np.concatenate([points[:1], sample_times(times, points, 1 / 120)])
    acceleration = np.diff(rows[:-1], 2, axis=0) * 120**2
    assert np.abs(acceleration).max() < 4.0  # straight pieces between the points: 11.6
    assert np.all(np.diff(rows, axis=0) > -1e-12)  # monotone like the path


def test_a_very_short_way_takes_the_time_of_a_triangle() -> None:
    times, _ = time_path(np.array([[0.0], [0.001]]), np.array([0.5]), np.array([1.0]))
    assert times[-1] == pytest.approx(2 * np.sqrt(0.001 / 1.0), rel=1e-6)


def test_a_straight_way_takes_the_time_of_a_trapezoid() -> None:
    times, _ = time_path(np.array([[0.0], [2.0]]), np.array([0.5]), np.array([1.0]))
    assert times[-1] == pytest.approx(2.0 / 0.5 + 0.5 / 1.0, rel=1e-3)


def test_joints_keep_their_acceleration_at_bends() -> None:
    random = np.random.default_rng(2)
    speed, acceleration = np.full(7, 1.2), np.full(7, 4.0)
    for _ in range(5):
        path = np.cumsum(random.uniform(-0.6, 0.6, size=(8, 7)), axis=0)
        times, points = time_path(path, speed, acceleration)
        durations = np.diff(times)
        velocity = np.diff(points, axis=0) / durations[:, None]
        change = np.diff(velocity, axis=0) / ((durations[1:] + durations[:-1]) / 2)[:, None]
        assert np.all(np.abs(velocity) <= speed * (1 + 1e-9))
        assert np.all(np.abs(change) <= acceleration * 1.001)
        assert set(map(tuple, path.round(9))) <= set(map(tuple, points.round(9)))  # no corner is cut


def test_a_body_that_is_put_elsewhere_for_a_while_comes_back_to_the_very_numbers(checker: CollisionChecker) -> None:
    world, before = checker.world, checker.world.pose("bottle_7")
    for step in range(5):
        with world.posed("bottle_7", transform_from_yaw(0.3 * step, np.array([1.0, 2.0, 3.0 + step]))):
            np.testing.assert_allclose(world.pose("bottle_7")[:3, 3], [1.0, 2.0, 3.0 + step], atol=1e-6)
        np.testing.assert_array_equal(world.pose("bottle_7"), before)


def test_what_is_asked_of_one_query_is_not_asked_of_the_next(checker: CollisionChecker) -> None:
    """In whatever order checks are made, each answers under its own query."""
    body = np.concatenate([[-1.3, -0.2, -np.pi / 2], PANDA.carry])
    low = np.eye(4)
    low[:3, 3] = [0.0, 0.0, 0.25]
    alone, held = checker.check_meshes(body), checker.under(carrying("bottle_7", low))
    collision = held.check_meshes(body)
    assert alone is None and collision is not None
    for _ in range(2):
        assert checker.check_meshes(body) is None
        assert held.check_meshes(body) == collision
    assert checker.overlaps("bottle_7") == checker.under(carrying("cup_5", low)).overlaps("bottle_7")

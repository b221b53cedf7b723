"""The closed forms of the arm against the numeric solver, and of paths against meshes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import forward, inverse_kinematics, random_starts
from scenewright.stages.kit.motion.rrt_connect import densify, first_collision
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.pack.arm import FixedArm, ToolPose
from scenewright.stages.pack.arm_scene import ArmScene
from scenewright.stages.pack.environment import PackingWorld, State
from scenewright.stages.pack.hand import Named, held_block, tool_over_centre
from scenewright.stages.pack.hand_shape import PUBLISHED, measured
from scenewright.stages.pack.instances import BASKETS, Instance, Obstacle, Rectangle, published_instance
from scenewright.stages.pack.motion import HOME_STANCE, MotionPlanner, open_arm
from scenewright.stages.pack.parameters import PackParameters, check_inputs
from scenewright.stages.pack.records import Action, BoxState
from scenewright.stages.pack.settling import rest_of
from scenewright.stages.pack.solids import Block, flat_depth, overlap
from scenewright.stages.pack.solved_arm import SolvedArm
from shapely import affinity
from shapely.geometry import Polygon, box

BOX = BoxState("red_box", 0.07, 0.05, 0.07, 0.45, 0.1, 0.0, False)


@pytest.fixture(scope="module")
def planner() -> Iterator[MotionPlanner]:
    made = MotionPlanner()
    yield made
    made.close()


def test_closed_form_kinematics_reach_the_pose() -> None:
    arm = FixedArm()
    random = np.random.default_rng(0)
    for _ in range(100):
        radius, angle = random.uniform(0.42, 0.78), random.uniform(-1.5, 1.5)
        pose = ToolPose(
            radius * np.cos(angle), radius * np.sin(angle), random.uniform(0.07, 0.2), random.uniform(-3, 3)
        )
        found = arm.solve(pose)
        np.testing.assert_allclose(arm.tool(found), pose.matrix(), atol=1e-9)
        assert np.all(found >= arm.chain.lower) and np.all(found <= arm.chain.upper)


def test_nothing_beyond_the_closed_form_reach_is_found_numerically() -> None:
    arm = FixedArm()
    random = np.random.default_rng(1)
    for z in (0.08, 0.1, 0.2):
        inside = ToolPose(arm.reach(z) - 0.001, 0.0, z, 0.3)
        assert arm.solve(inside) is not None
        beyond = ToolPose(arm.reach(z) + 0.004, 0.0, z, 0.3)
        assert not inverse_kinematics(arm.chain, beyond.matrix(), random_starts(arm.chain, 6, random)).found
        with pytest.raises(MotionFailed) as failed:
            arm.solve(beyond)
        assert failed.value.failure.kind == "no_inverse_kinematics"
        assert failed.value.failure.numbers["distance"] == pytest.approx(0.004, abs=1e-6)


def test_a_pose_that_only_limits_forbid_is_said_to_be_so() -> None:
    with pytest.raises(MotionFailed) as failed:
        FixedArm().solve(ToolPose(0.13, 0.0, 0.08, 0.0))
    assert failed.value.failure.kind == "joint_limit"


def _polygon(block: Block) -> Polygon:
    flat = box(-block.half_width, -block.half_length, block.half_width, block.half_length)
    return affinity.translate(affinity.rotate(flat, block.yaw, origin=(0, 0), use_radians=True), block.x, block.y)


_numbers = st.floats(-0.15, 0.15)
_halves = st.floats(0.01, 0.1)


@settings(max_examples=150, deadline=None)
@given(_numbers, _numbers, st.floats(-3, 3), st.floats(-3, 3), _halves, _halves, _halves, _halves)
def test_overlap_agrees_with_polygons(x, y, yaw, other_yaw, a, b, c, d) -> None:  # type: ignore[no-untyped-def]
    first, second = Block(0, 0, yaw, a, b, 0, 1), Block(x, y, other_yaw, c, d, 0.5, 1.5)
    depth = flat_depth(first, second)
    if abs(depth) > 1e-9:
        assert (depth > 0) == (_polygon(first).intersection(_polygon(second)).area > 0)
    assert (overlap(first, second) > 0) == (depth > 0)
    assert overlap(first, Block(x, y, other_yaw, c, d, 1.0, 2.0)) <= 0


def test_motions_that_closed_forms_call_free_are_free_for_meshes(planner: MotionPlanner) -> None:
    """The second implementation: pybullet's meshes of the arm, held box and all that stands, on the dense path."""
    scene = ArmScene(planner.arm)
    random = np.random.default_rng(2)
    searched = planner.mesh_calls
    try:
        for _ in range(6):
            stance = HOME_STANCE
            blocks = [
                Named(f"b{k}", Block(x, random.uniform(-0.09, 0.09), random.uniform(-1, 1), 0.03, 0.04, 0.0, top))
                for k, (x, top) in enumerate(((0.57, 0.08), (0.66, 0.06), (0.74, 0.1)))
            ]
            for held, pose in (
                (None, ToolPose(BOX.x, BOX.y, 0.04 + tool_over_centre(0.07), 0.0)),
                (BOX, ToolPose(0.6, random.uniform(0.2, 0.3), 0.1, random.uniform(-3, 3))),
            ):
                motion = planner.plan(stance, pose, held, tuple(blocks))
                carried = None
                if held is not None:
                    carried = (held.name, held_block(pose, 0.07, 0.05, 0.07), tool_over_centre(0.07))
                scene.arrange(tuple(blocks), carried)
                assert first_collision(densify(motion.path, np.full(7, 0.05)), scene.check) is None
                np.testing.assert_allclose(motion.path[-1], motion.end.arm, atol=1e-3)
                stance = motion.end
    finally:
        scene.close()
    assert planner.mesh_calls == searched


def test_joint_1_may_turn_past_the_half_turn_on_the_way(planner: MotionPlanner) -> None:
    """From behind the robot the shorter way to its right side passes azimuth pi: joint 1 ends a whole turn further."""
    height = 0.03 + tool_over_centre(0.05)
    behind = planner.plan(HOME_STANCE, ToolPose(-0.5, 0.15, height, 0.0), None, ())
    beside = planner.plan(behind.end, ToolPose(0.12, -0.5, height, 0.0), None, ())
    assert beside.end.arm[0] > np.pi
    np.testing.assert_allclose(beside.path[0], behind.end.arm, atol=1e-3)
    np.testing.assert_allclose(beside.path[-1], beside.end.arm, atol=1e-3)
    assert np.abs(np.diff(beside.path, axis=0)).max() < 0.5


def test_a_box_over_even_ground_settles_as_physics_says(planner: MotionPlanner) -> None:
    with PackingWorld(published_instance("hard", 5), planner=planner) as world:
        state, _ = world.step(world.initial, Action("pick", "green_box"))
        state, _ = world.step(state, Action("place", "green_box", 0.65, 0.02, 0.4))
        let_go = rest_of(BoxState("green_box", 0.105, 0.035, 0.07, 0.65, 0.02, 0.4, False), 0.015)
        fallen = world._table.settle(world.initial.rests | {"green_box": let_go})
        for name, rest in state.rests.items():
            np.testing.assert_allclose(rest.position, fallen[name].position, atol=5e-4)
            np.testing.assert_allclose(np.abs(rest.quaternion), np.abs(fallen[name].quaternion), atol=2e-3)


def test_checks_come_in_order_with_names_and_numbers(planner: MotionPlanner) -> None:
    boxes = (BOX, BoxState("blue_box", 0.07, 0.07, 0.07, 0.65, 0.0, 0.0, False))
    post = Obstacle(Rectangle("post_1", (0.69, -0.105), (0.72, 0.105)), 0.16)
    with PackingWorld(Instance("own", boxes, BASKETS["medium"], (post,)), planner=planner) as world:
        held, _ = world.step(world.initial, Action("pick", "red_box"))

        def refused(x: float, y: float, yaw: float = 0.0) -> object:
            with pytest.raises(MotionFailed) as failed:
                world.step(held, Action("place", "red_box", x, y, yaw))
            return failed.value.failure

        assert refused(0.9, 0.0).kind == "no_inverse_kinematics"  # type: ignore[attr-defined]
        hit = refused(0.60, 0.01)
        assert hit.kind == "goal_in_collision" and hit.objects == ("blue_box", "red_box")  # type: ignore[attr-defined]
        assert hit.numbers["depth"] == pytest.approx(0.02, abs=1e-6)  # type: ignore[attr-defined]
        by_hand = refused(0.757, 0.05, np.pi / 2)
        assert (by_hand.kind, by_hand.objects) == ("goal_in_collision", ("post_1", "hand"))  # type: ignore[attr-defined]


def test_a_box_counts_as_packed_by_its_bounds(planner: MotionPlanner) -> None:
    low, high = BASKETS["small"].low, BASKETS["small"].high
    with PackingWorld(Instance("own", (BOX,), BASKETS["small"]), planner=planner) as world:

        def outside(x: float, y: float, yaw: float) -> tuple[str, ...]:
            placed = BoxState("red_box", 0.07, 0.05, 0.07, x, y, yaw, False)
            return world.outside(State({"red_box": rest_of(placed, 0.007)}, HOME_STANCE))

        assert outside(high[0] + 0.0149 - 0.035, 0.0, 0.0) == ()
        assert outside(high[0] + 0.0151 - 0.035, 0.0, 0.0) == ("red_box",)
        assert outside(high[0] + 0.0149 - 0.035, 0.0, np.pi / 4) == ("red_box",)
        assert outside(0.65, low[1] - 0.0151 + 0.025, 0.0) == ("red_box",)


# --- other arms ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["ur5e", "xarm7"])
def other(request: pytest.FixtureRequest) -> Iterator[MotionPlanner]:
    made = MotionPlanner(robot=request.param)
    yield made
    made.close()


def test_another_arm_reaches_poses_by_search_and_says_how_far_it_is(other: MotionPlanner) -> None:
    arm = other.arm
    random = np.random.default_rng(0)
    for _ in range(10):
        radius, angle = random.uniform(0.4, 0.6), random.uniform(-0.8, 0.8)
        pose = ToolPose(radius * np.cos(angle), radius * np.sin(angle), 0.1, random.uniform(-1.5, 1.5))
        found = arm.solve(pose, arm.home)
        np.testing.assert_allclose(forward(arm.chain, found), pose.matrix(), atol=2e-3)
        assert np.all(found >= arm.chain.lower) and np.all(found <= arm.chain.upper)
    beyond = arm.reach(0.1) + 0.05
    with pytest.raises(MotionFailed) as failed:
        arm.solve(ToolPose(beyond, 0.0, 0.1, 0.0), arm.home)
    assert failed.value.failure.kind == "no_inverse_kinematics"
    assert failed.value.failure.numbers["nearest_x"] == pytest.approx(arm.reach(0.1), abs=1e-6)


def test_motions_of_another_arm_are_free_for_meshes(other: MotionPlanner) -> None:
    standing = (Named("b", Block(0.6, 0.0, 0.3, 0.03, 0.04, 0.0, 0.08)),)
    taken = other.plan(other.home, ToolPose(BOX.x, BOX.y, 0.04 + tool_over_centre(0.07), 0.0), None, standing)
    placed = other.plan(taken.end, ToolPose(0.55, -0.15, 0.1, 0.5), BOX, standing)
    scene = ArmScene(other.arm)
    try:
        scene.arrange(standing, None)
        for motion, start in ((taken, other.home.arm), (placed, taken.end.arm)):
            np.testing.assert_allclose(motion.path[0], start, atol=1e-9)
            np.testing.assert_allclose(motion.path[-1], motion.end.arm, atol=1e-9)
            assert first_collision(densify(motion.path, np.full(len(start), 0.05)), scene.check) is None
            assert np.abs(np.diff(motion.path, axis=0)).max() < 0.4
    finally:
        scene.close()


def test_a_hand_is_measured_by_its_shapes() -> None:
    hand = measured(load_robot("ur5e"))
    assert hand.palm == pytest.approx((0.038, 0.038, 0.047, 0.163)) and hand.tip_below == 0.0
    assert hand.finger == pytest.approx((0.014, 0.007, 0.0, 0.105)) and hand.finger_offset == pytest.approx(0.0495)
    franka = measured(load_robot("panda"))
    assert franka.finger == PUBLISHED.finger and franka.palm[:2] == pytest.approx(PUBLISHED.palm[:2])


def test_an_arm_of_the_frankas_build_keeps_its_closed_forms(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('like = "panda"\nname = "mine"\n')
    mine = MotionPlanner(robot=str(tmp_path / "mine.toml"))
    assert isinstance(mine.arm, FixedArm)
    motion = mine.plan(mine.home, ToolPose(0.5, 0.1, 0.1, 0.0), None, ())
    assert motion.path.shape[1] == 7 and mine.mesh_calls == 0
    assert isinstance(open_arm("fr3", "ur5"), SolvedArm)
    with pytest.raises(UsageError, match="--limits panda are the Panda's"):
        check_inputs(PackParameters(robot="ur5", limits="panda"), {})

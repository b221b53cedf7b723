"""Physics: the arm's kinematics against its table of lengths, bodies against closed forms, primitives with contact."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from benchmarks.tidy.physics_pulls import divergence
from benchmarks.tidy.physics_records import PhysicsRun, metrics
from stages.kit.motion.kinematics import arm_chain, forward
from stages.kit.simulation.robot_description import load_robot
from stages.tableware.planning.actions import grasp, grasp_two, stack
from stages.tableware.simulation.physics import PhysicsTable
from stages.tableware.simulation.pieces import DISH_DENSITY, MARGIN, shell_pieces, solid
from stages.tableware.simulation.recording import Recording
from stages.tableware.world.dish_shapes import shell_volume
from stages.tableware.world.items import MEASURES, Table, make_item

DENAVIT_HARTENBERG = (
    (0.089159, 0.0, pi / 2), (0.0, -0.425, 0.0), (0.0, -0.39225, 0.0), (0.10915, 0.0, pi / 2),
    (0.09465, 0.0, -pi / 2), (0.0823 + 0.163, 0.0, 0.0),
)  # fmt: skip
"""d, a, alpha of the UR5; the last with the hand's length."""


def by_table(arm: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    for q, (d, a, alpha) in zip(arm, DENAVIT_HARTENBERG, strict=True):
        c, s, ca, sa = cos(q), sin(q), cos(alpha), sin(alpha)
        pose = pose @ np.array(
            [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]]
        )
    return pose


def test_the_arm_moves_as_its_published_lengths_say() -> None:
    chain = arm_chain(load_robot("ur5"))
    random = np.random.default_rng(0)
    for _ in range(20):
        arm = random.uniform(-pi, pi, 6)
        assert np.allclose(forward(chain, arm), by_table(arm), atol=1e-6)


@pytest.mark.parametrize("kind", ["cup", "bowl", "plate"])
def test_a_dish_weighs_what_its_volume_says_and_its_pieces_keep_within_it(kind: str) -> None:
    measures = MEASURES[kind]  # type: ignore[index]
    body = solid(kind)  # type: ignore[arg-type]
    assert body.mass == pytest.approx(DISH_DENSITY * shell_volume(measures), rel=0.005)
    assert body.center[2] < measures.height / 2
    assert body.inertia[0] == pytest.approx(body.inertia[1], rel=1e-6)
    for corners in shell_pieces(measures)[:-1]:
        radii = np.hypot(corners[:, 0], corners[:, 1])
        for radius, height in zip(radii, corners[:, 2], strict=True):
            assert radius <= measures.outer_radius(height) - 0.9 * MARGIN
            # a facet's middle is nearer than its corners
            assert radius >= measures.inner_radius(height)


def test_a_nested_stack_stands_still_as_high_as_the_shapes_say() -> None:
    rise = MEASURES["cup"].nesting_rise
    items = [make_item("a", "cup", 0.1, 0.0)]
    items.append(make_item("b", "cup", 0.1, 0.0, z=rise, on="a"))
    items.append(make_item("c", "cup", 0.1, 0.0, z=2 * rise, on="b"))
    world = PhysicsTable(Table(tuple(items)))
    before = {name: world.top.pose(name) for name in "abc"}
    world.top.rest(0.3)
    after = world.top.read()
    assert [after.by_name[name].on for name in "abc"] == [None, "a", "b"]
    assert after.by_name["c"].position[2] == pytest.approx(2 * rise, abs=0.001)
    assert all(np.abs(world.top.pose(name) - before[name]).max() < 0.002 for name in "abc")
    world.close()


@pytest.mark.parametrize("kind", ["cup", "bowl", "fork"])
def test_a_thing_alone_is_lifted_by_friction_and_binned(kind: str) -> None:
    recording = Recording()
    world = PhysicsTable(Table((make_item("it", kind, 0.1, 0.1, 0.4),)), record=recording)  # type: ignore[arg-type]
    world.do(grasp(world.table, "it", 0.5))
    assert (world.trial.moved, world.trial.dropped, world.trial.left, world.trial.trips) == (1, 0, 0, 1)
    assert 2.0 < world.trial.seconds < 15.0
    arrays = recording.arrays()
    assert arrays["poses"].shape == (len(recording.labels), 1, 4, 4)
    lifted = recording.labels.index("lifted")
    assert arrays["poses"][lifted, 0, 2, 3] > 0.04 and np.isnan(arrays["poses"][-1]).all()
    world.close()


def test_two_cups_side_by_side_come_in_one_trip() -> None:
    world = PhysicsTable(Table((make_item("a", "cup", 0.1, 0.1), make_item("b", "cup", 0.2, 0.1))))
    world.do(grasp_two(world.table, "a", "b"))
    assert (world.trial.moved, world.trial.trips) == (2, 1)
    world.close()


def test_a_cup_is_stacked_into_another() -> None:
    world = PhysicsTable(Table((make_item("a", "cup", -0.1, 0.1), make_item("b", "cup", 0.15, 0.05))))
    world.do(stack(world.table, "a", "b"))
    upper = world.table.by_name["a"]
    assert upper.on == "b" and upper.position[2] == pytest.approx(MEASURES["cup"].nesting_rise, abs=0.002)
    world.close()


def test_a_pull_ends_where_it_should_though_the_cup_stood_elsewhere() -> None:
    found = divergence("cups", 20, 2)
    assert found["initial"] > 0.3 and found["final"] < 0.3


def test_a_knocked_cup_is_counted_and_no_longer_on_the_table() -> None:
    world = PhysicsTable(Table((make_item("up", "cup", 0.2, 0.1), make_item("over", "cup", -0.2, 0.0))))
    lying = world.top.pose("over")
    lying[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    lying[2, 3] = 0.05
    world.top.place("over", lying)
    world.top.wake_near([np.array([-0.2, 0.0])], 0.2)
    world.do(grasp(world.table, "up"))
    assert (world.trial.moved, world.trial.dropped, world.trial.left) == (1, 1, 0)
    assert world.top.tipped() == ("over",)
    world.close()


def test_figures_are_of_tables_that_all_arms_ran() -> None:
    def run(arm: str, seed: int, time: float, dropped: int) -> PhysicsRun:
        return PhysicsRun(
            arm=arm, tier="tier1", seed=seed, sight="image", time=time, trips=6, moved=12 - dropped, pulls=0, stacks=0,
            dropped=dropped, left=0, actions=6, perception=dropped, policy=0, troubles=(), cpu_seconds=1.0,
        )  # fmt: skip

    figures = metrics([run("random", 1, 80.0, 0), run("random", 2, 10.0, 0), run("ours", 1, 40.0, 3)])
    assert figures["ours/tier1/physics/time_ratio"] == 2.0
    assert figures["random/tier1/physics/trials"] == 1
    assert figures["ours/tier1/physics/failures_perception"] == 1.0
    assert figures["ours/tier1/physics/failures_policy"] == 0.0
    assert figures["ours/tier1/physics/items_lost_share"] == 0.25

"""Physics: the arm's kinematics against its table of lengths, bodies against closed forms, primitives with contact."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.kit.motion.kinematics import arm_chain, forward
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.tableware.actions.grasp import Grasp, grasp, grasp_two
from scenewright.stages.tableware.actions.stack import stack
from scenewright.stages.tableware.parameters import SimulateParameters, check_simulate
from scenewright.stages.tableware.planning.action import Action
from scenewright.stages.tableware.planning.rules import Rules, why_not_pulled
from scenewright.stages.tableware.planning.time_model import TimeModel
from scenewright.stages.tableware.simulation.arm_times import FILE, ArmTimes, arm_times
from scenewright.stages.tableware.simulation.hand_fit import fitting_robot, tips
from scenewright.stages.tableware.simulation.holds import Hold, pair_hold, rim_hold, unevenness
from scenewright.stages.tableware.simulation.physics import PhysicsTable, Speeds, finger_force
from scenewright.stages.tableware.simulation.physics_pictures import key_frames
from scenewright.stages.tableware.simulation.physics_trial import alone
from scenewright.stages.tableware.simulation.pieces import DISH_DENSITY, MARGIN, shell_pieces, solid
from scenewright.stages.tableware.simulation.recording import Recording
from scenewright.stages.tableware.simulation.tabletop import where_it_passed
from scenewright.stages.tableware.simulation.trial import Done, Trial, most_actions, run_in
from scenewright.stages.tableware.simulators import SIMULATORS
from scenewright.stages.tableware.world.items import STANDARD, Item, Kind, Table, make_item, stand_height

from benchmarks.experiments.tidy_holds import held
from benchmarks.experiments.tidy_physics import Run
from benchmarks.experiments.tidy_pulls import divergence, pair
from benchmarks.tidy.physics_times import fit
from tests.unit.tableware.volumes import shell_volume

DENAVIT_HARTENBERG = (
    (0.089159, 0.0, pi / 2),
    (0.0, -0.425, 0.0),
    (0.0, -0.39225, 0.0),
    (0.10915, 0.0, pi / 2),
    (0.09465, 0.0, -pi / 2),
    (0.0823 + 0.163, 0.0, 0.0),
)
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
    chain = arm_chain(load_robot("ur5_bench"))
    random = np.random.default_rng(0)
    for _ in range(20):
        arm = random.uniform(-pi, pi, 6)
        assert np.allclose(forward(chain, arm), by_table(arm), atol=1e-6)


@pytest.mark.parametrize("robot", ["ur5e", "xarm7"])
def test_another_arm_with_the_same_hand_bins_a_cup(robot: str) -> None:
    world = PhysicsTable(Table((make_item("it", "cup", 0.1, 0.1, 0.4),)), robot=fitting_robot(robot))
    world.do(grasp(world.table, "it", 0.5))
    assert (world.trial.moved, world.trial.dropped, world.troubles) == (1, 0, [])
    world.close()


def test_the_measures_of_a_hand_are_those_of_its_description() -> None:
    assert tips(load_robot("ur5e")) == pytest.approx((0.007, 0.011, 0.0), abs=1e-9)
    with pytest.raises(BadInput, match="its hand opens 80 mm; holds of dishes are made for 85 mm"):
        fitting_robot("panda")


def test_a_robot_without_physics_is_refused() -> None:
    with pytest.raises(UsageError, match="--robot ur5e: the time model has no arm"):
        check_simulate(SimulateParameters(robot="ur5e"), {})


@pytest.mark.parametrize("kind", ["cup", "bowl", "plate"])
def test_a_dish_weighs_what_its_volume_says_and_its_pieces_keep_within_it(kind: str) -> None:
    measures = STANDARD[kind]  # type: ignore[index]
    body = solid(kind, measures)  # type: ignore[arg-type]
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
    rise = STANDARD["cup"].nesting_rise
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


@pytest.mark.parametrize("kind", ["cup", "bowl", "plate", "fork"])
def test_a_thing_alone_is_lifted_by_friction_and_binned(kind: str) -> None:
    recording = Recording()
    world = PhysicsTable(Table((make_item("it", kind, 0.1, 0.1, 0.4),)), record=recording)  # type: ignore[arg-type]
    world.do(grasp(world.table, "it", 0.5))
    assert (world.trial.moved, world.trial.dropped, world.trial.left, world.trial.trips) == (1, 0, 0, 1)
    assert 2.0 < world.trial.seconds < 15.0
    arrays = recording.arrays()
    assert arrays["poses"].shape == (len(recording.labels), 1, 4, 4)
    lifted = recording.labels.index("lifted")
    least = 0.02 if kind == "plate" else 0.04  # a plate hangs from its rim
    assert arrays["poses"][lifted, 0, 2, 3] > least and np.isnan(arrays["poses"][-1]).all()
    world.close()


def test_two_cups_side_by_side_come_in_one_trip() -> None:
    world = PhysicsTable(Table((make_item("a", "cup", 0.1, 0.1), make_item("b", "cup", 0.2, 0.1))))
    world.do(grasp_two(world.table, "a", "b"))
    assert (world.trial.moved, world.trial.trips) == (2, 1)
    world.close()


def test_nested_cups_beside_nested_cups_do_not_creep_out_of_the_grasp() -> None:
    row = held("cc|cc", 1)
    assert row.stood and (row.moved, row.dropped) == (4, 0)
    assert row.tilt < 15.0


def test_two_utensils_side_by_side_are_held_level_though_their_heads_touch() -> None:
    tilts: list[float] = []

    def watch(world: PhysicsTable, label: str) -> None:
        if label == "over the bin":
            tilts.extend(world.top.lean(name) for name in world.top.bodies)

    items = (make_item("a", "spoon", 0.0, 0.1, 0.1), make_item("b", "fork", 0.003, 0.128, 0.1))
    world = PhysicsTable(Table(items), record=watch)
    world.do(grasp_two(world.table, "a", "b"))
    assert (world.trial.moved, world.trial.trips) == (2, 1)
    assert max(tilts) < 0.15
    world.close()


def test_pads_that_give_hold_two_utensils_of_unequal_width_that_lie_on_each_other() -> None:
    spoon = make_item("low", "spoon", 0.0, 0.1, 0.3)
    fork = make_item("high", "fork", 0.0015, 0.1, 0.3, z=0.003, on="low")
    assert unevenness([spoon, fork], -0.01) < unevenness([spoon, fork], 0.01)
    world = PhysicsTable(Table((spoon, fork)))
    world.do(grasp(world.table, "low"))
    assert (world.trial.moved, world.trial.left) == (2, 0)
    world.close()


def test_jaws_that_do_not_fit_are_not_closed() -> None:
    items = [make_item("a", "cup", 0.1, 0.1), make_item("b", "cup", 0.195, 0.1)]
    items.append(make_item("across", "fork", 0.1, 0.1, 0.0, z=0.08, on="a"))
    world = PhysicsTable(Table(tuple(items)))
    world.do(grasp_two(world.table, "a", "b"))
    assert world.troubles and (world.trial.moved, world.trial.trips, world.trial.left) == (0, 0, 3)
    world.close()


def test_jaws_open_less_between_bowls_with_cups_in_them() -> None:
    """Bowls in bowls leave little room beside a cup."""

    def pair(pile: tuple[Kind, ...]) -> Hold:
        items: tuple[Item, ...] = ()
        for name, x in (("a", -0.087), ("b", 0.087)):
            below = None
            for number, kind in enumerate(pile):
                item = make_item(f"{name}{number}", kind, x, 0.0, on=below)
                if below is not None:
                    z = stand_height(Table(items), item, below)
                    item = replace(item, position=(x, 0.0, z))
                items, below = (*items, item), item.name
        table = Table(items)
        action = grasp_two(table, "a0", "b0")
        return pair_hold(table, "a0", "b0", action.p_G, action.theta_G)

    bare, laden = pair(("bowl", "bowl")), pair(("bowl", "bowl", "cup"))
    assert bare.clearance >= 0.0 and laden.clearance >= 0.0 and laden.opening < bare.opening - 0.004


def test_a_rim_is_not_taken_where_a_utensil_leans_in_the_dish() -> None:
    """Its middle may lie lower than the fingertips: an end of it stands up to the rim all the same."""
    bowl = make_item("b", "bowl", 0.0, 0.0)
    fork = replace(make_item("f", "fork", 0.0, 0.0, 0.0, on="b"), position=(0.0, 0.0, 0.03))
    hold = rim_hold(Table((bowl, fork)), "b", 0.0)
    assert hold.clearance >= 0.0 and abs(hold.pose[1, 3]) > 0.02
    assert abs(rim_hold(Table((bowl,)), "b", 0.0).pose[1, 3]) < 1e-6


def test_what_falls_is_binned_by_where_it_passed_the_opening() -> None:
    """Thrown sideways at 1 m/s it has gone 0.4 m aside at the first look, of which 0.3 m below the opening."""
    fell, drop = 0.4, 0.1
    speed = 9.81 * fell
    z = 0.5 * 9.81 * drop**2 - 0.5 * 9.81 * fell**2  # passed the opening after 0.1 s
    x, y = where_it_passed(np.array([fell, 0.0, z]), np.array([1.0, 0.0, -speed]))
    assert x == pytest.approx(drop) and y == 0.0
    assert where_it_passed(np.array([0.3, 0.1, -0.06]), np.array([0.0, 0.0, 0.0])) == (0.3, 0.1)


@pytest.mark.parametrize(("first", "second", "force"), [("c", "c", 20.0), ("b", "c", 40.0), ("b", "b", 120.0)])
def test_cups_are_pressed_less_than_bowls_and_heavy_pairs_more(first: str, second: str, force: float) -> None:
    kinds: dict[str, Kind] = {"c": "cup", "b": "bowl"}
    items: tuple[Item, ...] = ()
    for name, x in (("a", -0.2), ("d", 0.2)):
        low = make_item(f"{name}0", kinds[first], x, 0.0)
        high = make_item(f"{name}1", kinds[second], x, 0.0, on=low.name)
        items = (*items, low, replace(high, position=(x, 0.0, stand_height(Table((low,)), high, low.name))))
    assert finger_force(Table(items), ["a0", "d0"], Speeds()) == force


def test_after_an_idle_action_the_pile_that_was_meant_is_taken_alone_then_the_highest_things() -> None:
    rise = STANDARD["cup"].nesting_rise
    cups = (
        make_item("a", "cup", 0.1, 0.0),
        make_item("b", "cup", 0.2, 0.0),
        make_item("c", "cup", 0.1, 0.0, z=rise, on="a"),
    )
    seen = Table(cups)
    done = Done(grasp_two(seen, "b", "a"), seen, seen, 0.0, 0.3, seen=seen)
    assert done.idle and done.action.in_kinds(seen) == "take c|cc"
    first, second = alone(seen, done, 1), alone(seen, done, 2)
    assert isinstance(first, Grasp) and first.items == ("b",)
    assert isinstance(second, Grasp) and second.items == ("c",)


def test_a_trial_whose_actions_are_tried_again_ends() -> None:
    class Still:
        """A table that nothing moves on."""

        def __init__(self) -> None:
            self.table, self.trial, self.asked = Table((make_item("a", "cup", 0.0, 0.0),)), Trial(left=1), 0

        def do(self, action: Action, seen: Table | None = None) -> None:
            self.asked += 1

    class Once:
        """Says how often it was asked."""

        asked = 0

        def decide(self, table: Table) -> Action:
            self.asked += 1
            return grasp(table, "a")

    world, policy = Still(), Once()
    run_in(world, policy, again=alone)
    assert (policy.asked, world.asked) == (1, most_actions(world.table))


def test_key_frames_are_in_order_and_end_with_the_last() -> None:
    labels = ["start", "closed", "lifted", "over the bin", "released", "done"] * 5
    rows = key_frames(labels, 6)
    assert len(rows) == 6 and rows == sorted(rows) and rows[-1] == len(labels) - 1
    assert key_frames(["start", "lifted", "done"], 6) == [1, 2]


def test_the_times_of_the_arm_are_found_back_and_those_kept_say_where_they_are_from() -> None:
    def run(trips: int, stacks: int, pulls: int, dropped: int = 0) -> Run:
        return Run(
            trips=trips,
            looks=0,
            losses=(),
            time=6.0 * trips + 5.0 * stacks + 4.0 * pulls + 90 * dropped,
            moved=12,
            pulls=pulls,
            stacks=stacks,
            dropped=dropped,
            left=0,
            actions=6,
            perception=0,
            policy=0,
            troubles=(),
            cpu_seconds=1.0,
        )

    found = fit([run(6, 0, 4), run(12, 0, 0), run(6, 6, 0), run(5, 2, 1), run(9, 9, 9, dropped=1)])
    assert found == pytest.approx((6.0, 5.0, 4.0, 0.0), abs=1e-6)
    kept = ArmTimes.read(FILE)
    assert kept.trials > 0 and "tuning seeds" in kept.conditions
    assert arm_times(5.0).whole_trip == pytest.approx(kept.trip + 10.0)


def test_in_physics_policies_plan_by_the_times_of_the_arm() -> None:
    def times(**options: Any) -> TimeModel:
        parameters = SimulateParameters(**options)
        return SIMULATORS[parameters.simulator](parameters).times

    assert times(simulator="physics") == arm_times()
    given = times(simulator="physics", stack_seconds=1.5)
    assert (given.stack, given.trip) == (1.5, arm_times().trip)
    assert times(simulator="fast").trip != arm_times().trip


def test_a_cup_is_stacked_into_another() -> None:
    world = PhysicsTable(Table((make_item("a", "cup", -0.1, 0.1), make_item("b", "cup", 0.15, 0.05))))
    world.do(stack(world.table, "a", "b"))
    upper = world.table.by_name["a"]
    assert upper.on == "b" and upper.position[2] == pytest.approx(STANDARD["cup"].nesting_rise, abs=0.002)
    world.close()


def test_a_pull_ends_where_it_should_though_the_cup_stood_elsewhere() -> None:
    found = divergence("cups", 20, 2)
    assert found["initial"] > 0.3 and found["final"] < 0.3


@pytest.mark.parametrize(("pile", "borne"), [("cc", True), ("ccc", False), ("bcc", False)])
def test_physics_bears_the_pulls_that_the_rule_allows(pile: str, borne: bool) -> None:
    assert (why_not_pulled(pile, Rules(steady_pulls=True)) is None) == borne
    assert pair(pile, 0)["kept"] == borne


def test_a_knocked_cup_is_counted_and_no_longer_on_the_table() -> None:
    world = PhysicsTable(Table((make_item("up", "cup", 0.2, 0.1), make_item("over", "cup", -0.2, 0.0))))
    lying = world.top.pose("over")
    lying[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    lying[2, 3] = 0.05
    world.top.place("over", lying)
    world.top.wake_near([np.array([-0.2, 0.0])], 0.2)
    world.do(grasp(world.table, "up"))
    assert (world.trial.moved, world.trial.dropped, world.trial.left) == (1, 1, 0)
    world.close()

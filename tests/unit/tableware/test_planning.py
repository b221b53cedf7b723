"""Planning with chance, obstacles and refusals; records of actions; eyes that follow names."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from math import pi

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.tableware_plan import TablewareAction
from scenewright.stages.tableware import simulators
from scenewright.stages.tableware.actions.grasp import Grasp, grasp, grasp_two
from scenewright.stages.tableware.actions.pull import pull
from scenewright.stages.tableware.actions.pull_grasp import pull_grasp
from scenewright.stages.tableware.actions.stack import stack
from scenewright.stages.tableware.actions.stack_grasp import stack_grasp
from scenewright.stages.tableware.parameters import SimulateParameters
from scenewright.stages.tableware.planning.choice import make_policy
from scenewright.stages.tableware.planning.joint import JointPolicy, plan, rules_in
from scenewright.stages.tableware.planning.optimum import Optimum, Solution
from scenewright.stages.tableware.planning.reasons import impossible_pairs
from scenewright.stages.tableware.planning.records import as_action, as_record
from scenewright.stages.tableware.planning.refusals import Doubt, Unknown, accept, statement
from scenewright.stages.tableware.planning.rules import (
    Rules,
    can_grasp_two,
    can_hold_two,
    can_pull,
    can_put,
    split_over_two,
)
from scenewright.stages.tableware.planning.time_model import (
    EXACT,
    Chances,
    TimeModel,
    fitted,
    measured,
    with_spills,
    with_thesis_failures,
)
from scenewright.stages.tableware.policies import ours_bold
from scenewright.stages.tableware.sight import named_as, understood, without_places
from scenewright.stages.tableware.simulation.fast import FastWorld, run_trial
from scenewright.stages.tableware.simulation.trial import run_in
from scenewright.stages.tableware.table_pictures import draw_strip, draw_table
from scenewright.stages.tableware.training.thesis_times.train import FAILED_TRIALS, TABLE_7_2, trips_of
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.world.footprints import Footprint, footprint, gap, overlapped
from scenewright.stages.tableware.world.items import Table, make_item
from scenewright.stages.tableware.world.scenes import make_table
from scenewright.stages.tableware.world.setting import Setting

MODEL = TimeModel(trip=10.0, stack=8.0, pull=5.0)
RULES, BOLD = Rules(), ours_bold.RULES


def test_two_cups_side_by_side_cost_what_their_slips_say() -> None:
    """One trip; with chance 1 - q the second stays and takes another: 10 + (1 - q) 10 s. A stacking takes 18 s."""
    table = Table((make_item("a", "cup", -0.05, 0.0), make_item("b", "cup", 0.05, 0.0)))
    for hold, expected in ((1.0, 10.0), (0.7, 13.0), (0.3, 17.0), (0.1, 18.0)):
        found = Optimum(table, RULES, MODEL, Chances({"c": hold})).solve()
        assert found.seconds[3] == pytest.approx(expected)
    assert found.trips[3] == 1.0  # at 0.1 the stacking


def test_the_expected_time_is_that_of_many_trials() -> None:
    table = make_table("tier0_cups", 3)
    chances = replace(measured(), noise=False)
    found = plan(table, RULES, MODEL, chances, off=0.0)
    policy = JointPolicy(RULES, MODEL, chances, off=0.0, made=found)
    times = [run_trial(table, policy, MODEL, chances, (3, draw)).seconds for draw in range(300)]
    assert np.mean(times) == pytest.approx(found.seconds, abs=3.0 * np.std(times) / np.sqrt(300))
    assert np.std(times) > 1.0


def test_luck_does_not_depend_on_the_order_of_actions() -> None:
    table = Table(
        tuple(make_item(name, "cup", x, 0.0) for name, x in (("a", -0.3), ("b", -0.2), ("c", 0.2), ("d", 0.3)))
    )
    chances = Chances({"c": 0.5})
    for draw in range(12):
        ends = []
        for pairs in ((("a", "b"), ("c", "d")), (("c", "d"), ("a", "b"))):
            world = FastWorld(table, MODEL, chances, (0, draw))
            for one, other in pairs:
                world.do(grasp_two(world.table, one, other))
            ends.append(sorted(world.table.by_name))
        assert ends[0] == ends[1]


def test_a_risk_in_the_cost_changes_the_plan() -> None:
    table = make_table("tier1", 4)
    risky = Chances(drop_stack=0.2, drop_pull=0.2, drop_loaded_pull=0.2)
    bold, careful = (plan(table, RULES, MODEL, risky, off=0.0, worth=worth) for worth in (0.0, 200.0))
    assert careful.lost < bold.lost and careful.seconds > bold.seconds
    assert all(not trip.stacks and trip.pull is None for trip in careful.trips)


def test_the_plan_of_least_regret_loses_little_whatever_a_trip_takes() -> None:
    """Neither the plan that is best for the model nor those for the ends have a smaller worst case."""
    for tier, seed in (("tier1", 6), ("tier2", 8)):
        table, model = make_table(tier, seed), fitted(tier)
        optimum = Optimum(table, RULES, model, EXACT)

        def worst(solution: Solution, optimum: Optimum = optimum, trip: float = model.whole_trip) -> float:
            at = optimum.everything
            ends = [
                (
                    solution.seconds[at] + charge * solution.trips[at],
                    (best := optimum.solve(charge)).seconds[at] + charge * best.trips[at],
                )
                for charge in (-0.3 * trip, 0.3 * trip)
            ]
            return max(mine / least for mine, least in ends)

        ours = worst(plan(table, RULES, model, EXACT).solution)
        best, low, high = (worst(optimum.solve(share * model.whole_trip)) for share in (0.0, -0.3, 0.3))
        assert 1.0 <= ours <= min(best, low, high) < max(best, low, high)
        assert plan(table, RULES, model, EXACT, off=0.0).seconds <= plan(table, RULES, model, EXACT).seconds


def test_drops_give_back_the_failed_trials_they_were_fitted_to() -> None:
    chances = with_thesis_failures()
    expected = 0.0
    for row in TABLE_7_2.values():
        trips = trips_of(row.pull)
        pulls = (trips_of(row.random) if row.piles is None else row.piles) - trips
        expected += 3 * (1 - (1 - chances.drop_two) ** trips * (1 - chances.drop_pull) ** pulls)
    assert expected == pytest.approx(sum(failed[2] for failed in FAILED_TRIALS.values()), abs=1e-6)
    assert 0.0 < chances.drop_single < chances.drop_stack < chances.drop_pull < 0.4


def test_overlaps_are_gaps_below_zero() -> None:
    random = np.random.default_rng(0)
    rows = [(*random.uniform(-0.2, 0.2, 4), random.uniform(0.001, 0.1)) for _ in range(40)]
    prints = [Footprint((a, b), (c, d) if row % 2 else (a, b), r) for row, (a, b, c, d, r) in enumerate(rows)]
    hits = overlapped(prints[:20], prints[20:])
    gaps = np.array([[gap(one, other) for other in prints[20:]] for one in prints[:20]])
    assert np.array_equal(hits, gaps < 0.0) and 50 < hits.sum() < 350


def test_a_split_is_one_that_the_jaws_hold() -> None:
    assert split_over_two("b", "b", ("c", "c"), RULES) is not None
    assert split_over_two("b", "b", ("b",) * 4, RULES) is not None
    assert split_over_two("b", "b", ("b",) * 5, RULES) is None  # seven bowls: four in one pile
    assert split_over_two("b", "b", ("c",), replace(RULES, both_piles=False)) is None
    some = replace(RULES, beside=frozenset({("b", "bc"), ("bc", "bc")}))
    assert split_over_two("b", "b", ("c",), some) is not None and split_over_two("b", "b", ("c", "c"), some) is not None
    assert split_over_two("b", "b", ("b",), some) is None and not can_hold_two("b", "b", some)


def test_laden_dishes_go_side_by_side_only_as_they_stand_and_where_nothing_spills() -> None:
    some = replace(RULES, beside=frozenset({("b", "b"), ("b", "bc")}))
    assert can_hold_two("bu", "bc", some) and can_hold_two("b", "b", some) and not can_hold_two("bc", "bc", some)
    assert split_over_two("b", "b", ("u",), some) is None and split_over_two("bu", "b", ("c",), some) is None
    dry = rules_in(some, with_spills())
    assert not can_hold_two("bu", "bc", dry) and can_hold_two("b", "bc", dry) and rules_in(some, measured()) is some


def test_what_spills_lies_on_the_table_and_is_planned_around() -> None:
    bowls = (make_item("a", "bowl", -0.087, 0.0), make_item("b", "bowl", 0.087, 0.0))
    fork = replace(make_item("f", "fork", -0.087, 0.0, 0.3, on="a"), position=(-0.087, 0.0, 0.07))
    table = Table((*bowls, fork))
    chances = Chances(spills=True)
    world = FastWorld(table, MODEL, chances, 0)
    world.do(grasp_two(table, "a", "b"))
    assert world.trial.moved == 2 and world.trial.dropped == 0 and world.table.by_name["f"].on is None
    assert footprint(world.table.by_name["f"]).on_table and world.troubles == ["f slid off"]
    sure, warned = plan(table, RULES, MODEL, EXACT), plan(table, RULES, MODEL, chances)
    assert len(sure.trips[0].bases) == 2 and all(len(trip.bases) == 1 for trip in warned.trips)


def test_what_is_not_understood_is_kept_clear_of() -> None:
    cups = (make_item("a", "cup", -0.3, 0.0), make_item("b", "cup", 0.3, 0.0))
    assert can_pull(Table(cups), "a", "b", RULES)
    guarded = Table(cups, ((0.0, 0.02, 0.03),))
    assert not can_pull(guarded, "a", "b", RULES) and not can_pull(guarded.moved("a", -0.3, 0.0), "a", "b", RULES)
    assert all(trip.pull is None for trip in plan(guarded, RULES, MODEL, EXACT).trips)
    near = Table((make_item("a", "cup", -0.05, 0.0), make_item("b", "cup", 0.05, 0.0)), ((0.0, 0.03, 0.03),))
    assert not can_grasp_two(near, "a", "b", RULES)


def test_refusals_name_their_reasons() -> None:
    table = Table(
        (make_item("a", "bowl", -0.2, 0.0), make_item("b", "cup", 0.0, 0.0), make_item("c", "cup", 0.37, 0.0))
    ).moved("b", -0.2, 0.0, on="a")
    found = accept(table, {"b": Doubt(0.2, ("glare",))}, (Unknown("unknown_1", 0.1, 0.1, 0.04),), 0.5, RULES)
    assert not found.table.items and len(found.table.obstacles) == 4
    reasons = {one.name: one.reason for one in found.refused}
    assert reasons == {"unknown_1": "unknown_object", "a": "in_a_refused_pile", "b": "unsure", "c": "outside_workspace"}
    assert "glare" in statement(found) and "\n" not in statement(found)
    assert statement(accept(Table(()), {}, (), 0.5, RULES)) == "the table is empty: nothing to clear"
    edge = Table((make_item("d", "cup", 0.346, 0.0), make_item("e", "fork", 0.0, 0.2))).moved("e", 0.346, 0.0, on="d")
    assert not accept(edge, {}, (), 0.5, RULES).refused  # a millimetre over it, and a fork that goes with its cup
    many = Table(tuple(make_item(f"cup_{n}", "cup", 0.0, 0.0) for n in range(61)))
    with pytest.raises(BadInput, match="61 items"):
        accept(many, {}, (), 0.5, RULES)


def test_detections_of_unknown_kind_and_low_confidence_are_not_planned_for() -> None:
    seen = understood(
        (
            Detection("cup", (0.0, 0.0, 0.0), lip=0.08, confidence=0.9),
            Detection("cup", (0.2, 0.0, 0.0), lip=0.08, confidence=0.4, unsure=("no depth",)),
            Detection(None, (0.0, 0.2, 0.0), lip=0.05, confidence=0.0, extent=0.05, unsure=("unknown object",)),
        ),
        0.5,
        Setting(),
    )
    assert [item.name for item in seen.table.items] == ["cup_1"]
    assert [one.reason for one in seen.refused] == ["unknown_object", "unsure"]


@pytest.mark.parametrize(("tier", "rules"), [("tier1", RULES), ("tier3", RULES), ("tier3", BOLD)])
def test_reasons_are_given_exactly_where_rules_forbid(tier: str, rules: Rules) -> None:
    table = make_table(tier, 1)
    given_for = {(one.primitive, one.first, one.second) for one in impossible_pairs(table, rules)}
    bases = [pile[0].name for pile in table.stacks]
    for one, other in permutations(bases, 2):
        assert (("pull", one, other) in given_for) == (not can_pull(table, one, other, rules))
        assert (("stack", one, other) in given_for) == (not can_put(table, one, other, rules))
    for row, one in enumerate(bases):
        for other in bases[row + 1 :]:
            assert (("multi_grasp", one, other) in given_for) == (not can_grasp_two(table, one, other, rules))


def test_a_pull_that_a_pile_does_not_bear_is_said_so() -> None:
    cups = [make_item(f"cup_{n}", "cup", 0.0, 0.0, z=0.0183 * n, on=f"cup_{n - 1}" if n else None) for n in range(3)]
    table = Table((*cups, make_item("far", "cup", 0.25, 0.0)))
    pulls = {one.first: one.kind for one in impossible_pairs(table, BOLD) if one.primitive == "pull"}
    assert pulls == {"cup_0": "tips"}


def test_actions_survive_their_records() -> None:
    table = Table((make_item("a", "cup", -0.2, 0.0), make_item("b", "cup", 0.1, 0.0), make_item("c", "bowl", 0.1, 0.2)))
    chances = with_thesis_failures()
    actions = (
        grasp(table, "a", 0.3),
        pull(table, "a", "b", RULES),
        pull_grasp(table, "a", "b", RULES),
        stack(table, "b", "c"),
        stack_grasp(table, "b", "c"),
    )
    for action in actions:
        record = TablewareAction.model_validate_json(as_record(action, table, MODEL, chances).model_dump_json())
        assert as_action(record) == action
        assert record.risk == pytest.approx(action.risk(table, chances)) and record.risk > 0.0
    with pytest.raises(ValueError, match="u_P"):
        TablewareAction(name="pull", seconds=1.0, risk=0.0)


def test_what_is_seen_gets_the_names_of_what_stands_there() -> None:
    known = Table((make_item("a", "cup", 0.0, 0.0), make_item("b", "fork", 0.2, 0.0, 0.3)))
    seen = Table(
        (make_item("x", "spoon", 0.21, 0.0, 0.3), make_item("y", "cup", 0.004, 0.0), make_item("z", "cup", 0.1, 0.1))
    )
    assert [item.name for item in named_as(seen, known).items] == ["b", "a", "stray_1"]
    lying = known.moved("b", 0.0, 0.0, on="a")
    shifted = Table((make_item("x", "cup", 0.0, 0.0), make_item("y", "spoon", 0.04, 0.0, z=0.08, on="x")))
    assert [item.name for item in named_as(shifted, lying).items] == ["a", "b"]


def test_where_the_hand_closed_on_nothing_nothing_is_believed() -> None:
    table = Table((make_item("a", "cup", 0.0, 0.0), make_item("b", "cup", 0.2, 0.0)))
    assert [item.name for item in without_places(table, [(0.21, 0.0)]).items] == ["a"]


def test_reaching_for_what_is_not_there_ends_the_trial() -> None:
    table = Table((make_item("a", "cup", 0.0, 0.0),))
    ghost = Table((make_item("stray_1", "cup", 0.2, 0.2),))

    class Stubborn:
        def decide(self, table: Table) -> Grasp:
            return grasp(table, "stray_1")

    world = FastWorld(table, MODEL, EXACT, 0)
    trial = run_in(world, Stubborn(), lambda world: ghost)
    assert trial.trips == 8 and trial.left == 1 and trial.failure == "perception"
    assert world.troubles == ["reached in vain for stray_1"]


def test_a_pile_that_is_more_than_seen_is_dropped() -> None:
    table = Table((make_item("a", "cup", 0.0, 0.0),))
    for number in range(3):
        new = make_item(f"b{number}", "cup", 0.2, 0.2)
        on = "a" if number == 0 else f"b{number - 1}"
        table = Table((*table.items, new)).moved(new.name, 0.0, 0.0, on=on)
    world = FastWorld(table, MODEL, EXACT, 0)
    world.do(grasp(table, "a"))
    assert world.trial.dropped == 4 and world.trial.failure == "policy"


def test_physics_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulators, "SIMULATION", "scenewright.stages.tableware.no_such_package")
    with pytest.raises(MissingDependency, match="no physics"):
        simulators.SIMULATORS["physics"](SimulateParameters(simulator="physics"))


def test_pictures_show_what_is_there() -> None:
    table = Table((make_item("a", "cup", -0.2, 0.0), make_item("b", "fork", 0.2, 0.1, pi / 3)), ((0.0, -0.2, 0.04),))
    empty, full = (np.asarray(draw_table(each, 300)) for each in (Table(()), table))
    changed = np.any(empty != full, axis=2)
    scale = 300 / 0.84
    at = lambda x, y: changed[round((0.305 + 0.03 - y) * scale), round((x + 0.39 + 0.03) * scale)]  # noqa: E731
    assert at(-0.2, 0.0) and at(0.2, 0.1) and at(0.0, -0.2) and not at(0.1, -0.1)
    strip = draw_strip([(table, grasp(table, "a"), "take a")] * 5, 600)
    assert strip.width == 600 and strip.height > 2 * 100


def test_every_policy_clears_a_table_by_its_name() -> None:
    table, model = make_table("tier2", 8), fitted("tier2")
    for name in ("random", "random_piles", "pull", "stack", "ours", "ours_without_loaded_pulls"):
        assert not run_trial(table, make_policy(name, model, EXACT, 0), model, EXACT, 0).failed

"""Tableware: shapes, scenes, rules, time model, the exact optimum against a search over single actions, the arms."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import UsageError
from scenewright.stages.tableware.actions.grasp import grasp_two, taken
from scenewright.stages.tableware.actions.pull import after_pull, pull
from scenewright.stages.tableware.actions.pull_grasp import pull_grasp
from scenewright.stages.tableware.actions.stack import after_stack, stack
from scenewright.stages.tableware.actions.stack_grasp import stack_grasp
from scenewright.stages.tableware.planning.joint import JointPolicy
from scenewright.stages.tableware.planning.optimum import Optimum, clear, seconds
from scenewright.stages.tableware.planning.policy import STANDARD_SETTING, THESIS
from scenewright.stages.tableware.planning.pulled_load import centre_height
from scenewright.stages.tableware.planning.rules import (
    Rules,
    can_grasp_two,
    can_hold,
    can_pull,
    can_put,
    can_stack,
    letters,
    why_not_pulled,
)
from scenewright.stages.tableware.planning.time_model import (
    EXACT,
    Chances,
    TimeModel,
    fitted,
    measured,
    placement_error,
    thesis_fit,
)
from scenewright.stages.tableware.planning.trip_options import slip_cost
from scenewright.stages.tableware.policies.pull import PullPolicy
from scenewright.stages.tableware.policies.random import RandomOne
from scenewright.stages.tableware.policies.random_piles import RandomPile
from scenewright.stages.tableware.policies.stack import StackPolicy
from scenewright.stages.tableware.simulation.fast import FastWorld, run_trial
from scenewright.stages.tableware.simulation.pieces import solid
from scenewright.stages.tableware.training.thesis_times.train import (
    TABLE_7_2,
    expected_trips,
    fit,
    fitted_hold,
    trips_of,
)
from scenewright.stages.tableware.world.footprints import Footprint, footprint, gap
from scenewright.stages.tableware.world.items import STANDARD, Item, Table, make_item, rise
from scenewright.stages.tableware.world.scenes import TIERS, make_table
from scenewright.stages.tableware.world.setting import Gripper, Setting

MODEL = TimeModel(trip=10.1, stack=8.45, pull=5.7)
DISHES = st.sampled_from(["cup", "bowl", "plate"])


@given(DISHES, DISHES)
def test_a_dish_comes_to_rest_where_walls_or_floor_touch(upper: str, lower: str) -> None:
    one, other = STANDARD[upper], STANDARD[lower]
    if one.rim_radius > other.rim_radius:
        return
    height = rise(one, other)

    def clearance(at: float) -> float:
        levels = np.linspace(max(at, 0.0), min(at + one.height, other.height), 400)
        walls = min(other.inner_radius(level) - one.outer_radius(level - at) for level in levels)
        return min(walls, at - other.wall)

    assert clearance(height) >= -1e-9
    assert clearance(height - 1e-4) < 0.0


def test_three_of_a_kind_fit_between_the_jaws_and_four_do_not() -> None:
    rules = Rules()
    for kind in "cb":
        assert can_hold(kind * 3, rules)
        assert not can_hold(kind * 4, rules)
    assert can_stack("c", "b", rules) and not can_stack("b", "c", rules) and not can_stack("c", "bu", rules)
    assert can_stack("u", "b", rules) and not can_stack("u", "c", rules)
    assert can_stack("u", "c", Rules(utensils_in_cups=True))
    assert can_hold("pp", rules) and not can_hold("pp", Rules(plates_alone=True))
    assert can_stack("u", "cu", rules) and can_stack("cu", "c", rules)


ends = st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))


@settings(max_examples=40)
@given(ends, ends, ends, ends, st.floats(0.001, 0.1), st.floats(0.001, 0.1))
def test_gap_is_the_least_distance_of_sampled_points(a, b, c, d, r, s) -> None:  # type: ignore[no-untyped-def]
    shares = np.linspace(0.0, 1.0, 300)[:, None]
    first, second = (np.array(p) + shares * (np.array(q) - np.array(p)) for p, q in ((a, b), (c, d)))
    sampled = np.linalg.norm(first[:, None] - second[None], axis=2).min() - r - s
    found = gap(Footprint(a, b, r), Footprint(c, d, s))
    assert found <= sampled + 1e-9
    assert sampled - found < (hypot(a[0] - b[0], a[1] - b[1]) + hypot(c[0] - d[0], c[1] - d[1])) / 299 + 1e-9


@pytest.mark.parametrize("tier", list(TIERS))
def test_scenes_hold_what_their_tier_says(tier: str) -> None:
    for seed in range(8):
        table = make_table(tier, seed)
        assert table == make_table(tier, seed)
        for kind, number in TIERS[tier].counts.items():
            assert sum(item.kind == kind for item in table.items) == number
        assert sum(item.on is not None for item in table.items) <= TIERS[tier].intersections
        assert max(len(pile) for pile in table.stacks) <= TIERS[tier].highest
        for pile in table.stacks:
            assert all(footprint(item).on_table for item in pile[:1])
            assert all(a.measures.rim_radius >= b.measures.rim_radius for a, b in zip(pile, pile[1:], strict=False))
            for other in table.stacks:
                if other is not pile:
                    assert min(gap(footprint(a), footprint(b)) for a in pile for b in other) > -1e-9
    assert make_table(tier, 0) != make_table(tier, 1)


def test_an_unknown_tier_is_refused() -> None:
    with pytest.raises(UsageError, match="tier9"):
        make_table("tier9", 0)


@pytest.mark.parametrize("tier", list(TABLE_7_2))
def test_time_model_gives_back_the_rows_it_was_fitted_to(tier: str) -> None:
    row, model = TABLE_7_2[tier], fitted(tier)
    piles = trips_of(row.random) if row.piles is None else row.piles
    assert trips_of(row.random) * model.trip == pytest.approx(row.random[0])
    for printed, increment in ((row.stack, model.stack), (row.pull, model.pull)):
        trips = trips_of(printed)
        assert trips * model.trip + (piles - trips) * increment == pytest.approx(printed[0])


def test_the_product_plans_by_what_was_fitted() -> None:
    assert fit() == thesis_fit()


def test_hold_chance_gives_back_the_trips() -> None:
    assert expected_trips(6, 1.0) == 3.0
    assert expected_trips(6, 0.0) == 6.0
    for tier in ("tier0_cups", "tier0_bowls", "tier0_utensils"):
        assert expected_trips(6, fitted_hold(tier)) == pytest.approx(trips_of(TABLE_7_2[tier].pull), abs=1e-6)


def test_a_slip_costs_half_a_trip_in_the_long_run() -> None:
    hold, items = 0.8, 3000
    slips = (1 - hold) * items / (1 + hold)
    extra = (expected_trips(items, hold) - items / 2) / slips
    assert extra == pytest.approx(0.5, abs=0.01)
    assert slip_cost(MODEL) == pytest.approx(0.5 * 10.1 + 0.5 * 5.7)


def test_placement_errors_have_the_measured_mean() -> None:
    random = np.random.default_rng(0)
    drawn = [hypot(*placement_error("bowl", 0.2, random)) for _ in range(4000)]
    assert np.mean(drawn) == pytest.approx(0.0092, rel=0.05)


def test_pull_grasp_and_stack_grasp_name_the_fields_of_the_equations() -> None:
    table = Table((make_item("a", "cup", -0.2, 0.0), make_item("b", "cup", 0.1, 0.0), make_item("c", "bowl", 0.1, 0.2)))
    both = pull_grasp(table, "a", "b", Rules())
    assert both.u_P.p_S[:2] == (-0.2, 0.0)
    assert both.u_P.p_E[0] == pytest.approx(0.1 - 0.09 - 0.01)
    assert both.u_G.p_G[0] == pytest.approx(0.1 - 0.045 - 0.005)
    put = stack_grasp(table, "b", "c")
    assert put.u_S.p_L == pytest.approx((0.1, 0.2, STANDARD["bowl"].wall))
    x, y, _ = put.u_G.p_G
    assert hypot(x - 0.1, y - 0.2) == pytest.approx(0.085 - STANDARD["bowl"].wall / 2)


def test_what_lies_between_forbids_a_pull() -> None:
    ends = (make_item("a", "cup", -0.3, 0.0), make_item("b", "cup", 0.3, 0.0))
    between = make_item("c", "spoon", 0.0, 0.04, yaw=pi / 2)
    assert can_pull(Table(ends), "a", "b", Rules())
    assert not can_pull(Table((*ends, between)), "a", "b", Rules())
    loaded = Table((*ends, make_item("d", "cup", -0.3, 0.0, z=0.0187, on="a")))
    assert can_pull(loaded, "a", "b", Rules()) and not can_pull(loaded, "a", "b", Rules(loaded_pulls=False))
    three = Table((*loaded.items, make_item("e", "cup", -0.3, 0.0, z=0.0373, on="d")))
    assert can_pull(three, "a", "b", Rules()) and not can_pull(three, "a", "b", Rules(steady_pulls=True))
    pulled = [
        {trip.pull for trip in clear(three, Rules(steady_pulls=steady), MODEL, EXACT)} for steady in (False, True)
    ]
    assert pulled == [{("a", "b")}, {("b", "a")}]


def _pulled(pile: str, setting: Setting = STANDARD_SETTING) -> str | None:
    return why_not_pulled(pile, Rules(setting=setting, steady_pulls=True))


def test_what_a_pulled_dish_may_carry_follows_from_shapes() -> None:
    borne = {pile: _pulled(pile) for pile in ("c", "cc", "ccc", "b", "bb", "bbb", "bc", "bbc", "bcc", "bu", "u")}
    assert {pile: why for pile, why in borne.items() if why} == {"ccc": "tips", "bcc": "no_room"}
    assert why_not_pulled("ccc", Rules()) is None and why_not_pulled("bcc", THESIS) is None


def test_a_wider_foot_bears_more_and_a_broader_finger_finds_less_room() -> None:
    cup, bowl = STANDARD["cup"], STANDARD["bowl"]
    broad = replace(STANDARD, cup=replace(cup, foot_radius=0.042, rim_radius=0.055))
    small = replace(STANDARD, bowl=replace(bowl, foot_radius=0.045, rim_radius=0.070))
    assert _pulled("ccc", Setting(broad)) is None
    assert _pulled("bc", Setting(small)) == "no_room"
    assert _pulled("bc", Setting(gripper=Gripper(finger=0.03))) == "no_room"
    assert _pulled("bcc", Setting(gripper=Gripper(jaw_height=0.07))) is None, "the knuckles stay above the cups"


def test_the_centre_of_mass_is_that_of_the_bodies() -> None:
    for kind in STANDARD.dishes:
        alone = Table((make_item("0", kind, 0.0, 0.0),))
        assert centre_height(alone) == pytest.approx(solid(kind, STANDARD[kind]).center[2], rel=1e-3)


def _small(seed: int) -> Table:
    """A table of four or five things, one perhaps on another."""
    random = np.random.default_rng(seed)
    items: list[Item] = []
    kinds = ["bowl", "cup", "bowl", "spoon", "cup"][: 4 + seed % 2]
    for number, kind in enumerate(kinds):
        while True:
            x, y, yaw = random.uniform(-0.25, 0.25), random.uniform(-0.2, 0.2), random.uniform(-pi / 2, pi / 2)
            item = make_item(f"{kind}_{number}", kind, x, y, yaw if kind == "spoon" else 0.0)  # type: ignore[arg-type]
            if all(gap(footprint(item), footprint(other)) > 0.002 for other in items):
                break
        items.append(item)
    table = Table(tuple(items))
    return table.moved("cup_1", *table.by_name["bowl_0"].position[:2], on="bowl_0") if seed % 3 == 0 else table


def _steps(table: Table, rules: Rules) -> Iterator[tuple[float, Table]]:
    """Every single action of section 6.2 and what it leaves."""
    bases = [pile[0].name for pile in table.stacks]
    for pile in table.stacks:
        for row, item in enumerate(pile):
            if can_hold(letters(pile[row:]), rules):
                yield MODEL.trip, table.without({other.name for other in pile[row:]})
            for base in bases:
                if base != pile[0].name and can_put(table, item.name, base, rules):
                    yield MODEL.stack, after_stack(table, stack(table, item.name, base))
    for one in bases:
        for other in bases:
            if can_grasp_two(table, one, other, rules):
                yield MODEL.trip, table.without(taken(table, grasp_two(table, one, other)))
            elif can_pull(table, one, other, rules):
                yield MODEL.pull, after_pull(table, pull(table, one, other, rules))


def _by_search(table: Table, rules: Rules) -> float:
    """Least time over all sequences of single actions, by Dijkstra."""
    order = count()
    queue = [(0.0, next(order), table)]
    seen = set()
    while queue:
        time, _, here = heapq.heappop(queue)
        if not here.items:
            return time
        key = frozenset((i.name, i.on, round(i.position[0], 5), round(i.position[1], 5)) for i in here.items)
        if key in seen:
            continue
        seen.add(key)
        for cost, after in _steps(here, rules):
            heapq.heappush(queue, (time + cost, next(order), after))
    raise AssertionError("a single grasp is always allowed")


@pytest.mark.parametrize("seed", [0, 2, 4, 5])
def test_the_optimum_is_that_of_a_search_over_single_actions(seed: int) -> None:
    table, rules = _small(seed), Rules()
    trips = clear(table, rules, MODEL, EXACT)
    assert seconds(trips) == pytest.approx(_by_search(table, rules))
    assert frozenset().union(*(trip.taken for trip in trips)) == frozenset(table.by_name)


@pytest.mark.parametrize("tier", ["tier0_utensils", "tier1", "tier2", "tier3"])
def test_the_plan_takes_as_long_as_it_says_when_nothing_slips(tier: str) -> None:
    table = make_table(tier, 3)
    said = seconds(clear(table, Rules(), MODEL, EXACT))
    trial = run_trial(table, JointPolicy(Rules(), MODEL, EXACT, off=0.0), MODEL, EXACT, 0)
    assert not trial.failed and trial.moved == len(table.items)
    assert trial.seconds == pytest.approx(said)
    for policy in (PullPolicy(), StackPolicy(), RandomOne(0), RandomPile(0)):
        other = run_trial(table, policy, MODEL, EXACT, 0)
        assert not other.failed and other.seconds >= said - 1e-9 and other.moved == len(table.items)


def test_a_charge_on_trips_buys_fewer_of_them() -> None:
    optimum = Optimum(make_table("tier1", 2), Rules(), MODEL, EXACT)
    free, charged = optimum.trips(), optimum.trips(optimum.solve(30.0))
    assert len(charged) < len(free) and seconds(charged) > seconds(free)
    assert len(charged) == 2  # four bowls and four cups are two piles twice, and utensils lie in bowls


def test_random_takes_one_item_a_trip_and_stack_two() -> None:
    table = make_table("tier1", 1)
    assert run_trial(table, RandomOne(0), MODEL, EXACT, 0).objects_per_trip == 1.0
    assert run_trial(table, StackPolicy(), MODEL, EXACT, 0).objects_per_trip == 2.0


def test_what_slips_stays_and_what_drops_is_a_failure() -> None:
    table = Table((make_item("a", "cup", -0.1, 0.0), make_item("b", "cup", 0.0, 0.0)))
    slipping = FastWorld(table, MODEL, Chances({"c": 0.0}), 0)
    slipping.do(grasp_two(table, "a", "b"))
    assert [item.name for item in slipping.table.items] == ["b"] and slipping.trial.moved == 1
    dropping = run_trial(table, RandomOne(0), MODEL, Chances(drop_single=1.0), 0)
    assert dropping.failed and dropping.moved == 0 and dropping.dropped == 2


def test_a_pull_that_misses_never_ends_inside_another_dish() -> None:
    table = Table((make_item("a", "bowl", -0.25, 0.0), make_item("b", "bowl", 0.2, 0.0)))
    for seed in range(40):
        world = FastWorld(table, MODEL, measured(), seed)
        world.do(pull(table, "a", "b", Rules(pull_gap=0.0)))
        assert gap(*(footprint(item) for item in world.table.items)) > -1e-3


def test_a_table_too_large_for_the_optimum_is_refused_there_and_cleared_in_portions_by_ours() -> None:
    places = [(0.1 * column - 0.3, 0.11 * row - 0.2) for column in range(6) for row in range(3)]
    table = Table(tuple(make_item(f"cup_{n}", "cup", x, y) for n, (x, y) in enumerate(places)))
    with pytest.raises(UsageError, match="18 items"):
        clear(table, Rules(), MODEL, EXACT)
    small = Table(tuple(item for item in table.items if item.position[0] < 0.1))
    assert not run_trial(small, JointPolicy(Rules(), MODEL, EXACT), MODEL, EXACT, 0).failed


def test_utensils_are_pulled_alongside() -> None:
    table = Table((make_item("a", "fork", 0.0, 0.0, yaw=0.4), make_item("b", "spoon", 0.1, 0.2, yaw=-1.0)))
    moved = after_pull(table, pull(table, "b", "a", Rules()))
    assert can_grasp_two(moved, "a", "b", Rules())
    across = np.array([-sin(0.4), cos(0.4)])
    assert abs(np.array(moved.by_name["b"].position[:2]) @ across) == pytest.approx(0.018 + 0.01)
    assert moved.by_name["b"].yaw == pytest.approx(0.4)

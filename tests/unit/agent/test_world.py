"""Apartments, persistent causes, distances, and what the words of tasks mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from scenewright.schemas.apartment import Apartment, Furniture, Room, Thing
from scenewright.stages.agent.brains.words import NotUnderstood, understood
from scenewright.stages.agent.exploration import explore
from scenewright.stages.agent.fast_marching import distances
from scenewright.stages.agent.goals import Move, Shut, kind
from scenewright.stages.agent.obstacle_map import ObstacleMap
from scenewright.stages.agent.scene_map import SceneMap
from scenewright.stages.agent.senses import Base, Sweep
from scenewright.stages.agent.tasks import TASKS, make_apartment
from scenewright.stages.agent.world.failures import COUNTS, EXECUTIONS, GRASPS, PLACES, TABLE_3_4, PrintedEyes, Rates
from scenewright.stages.agent.world.fast import FastWorld
from scenewright.stages.kit.acting.errors import Luck, segmenter_rates

NOTHING_FAILS = Rates().scaled(0.0, 0.0)


@pytest.mark.parametrize("task", TASKS.values(), ids=lambda task: task.name)
def test_words_mean_what_the_judge_asks_for(task) -> None:  # type: ignore[no-untyped-def]
    assert understood(task.words) == task.goals


def test_other_words() -> None:
    assert understood("on(bottle, table), closed(fridge)") == (
        Move(kind("bottle"), kind("table")),
        Shut(kind("fridge")),
    )
    for words in ("", "sing", "put the flurb on the table", "put the cup on the moon", "x" * 5000):
        with pytest.raises(NotUnderstood):
            understood(words)


@pytest.mark.parametrize("name", ["tidy_table", "drawer_spoon"])
def test_an_apartment_is_its_seed_and_keeps_passages(name: str) -> None:
    apartment = make_apartment(TASKS[name], 5)
    assert apartment == make_apartment(TASKS[name], 5) != make_apartment(TASKS[name], 6)
    assert 2 <= len(apartment.rooms) <= 4 and len(apartment.doors) >= len(apartment.rooms) - 1
    for k, a in enumerate(apartment.furniture):
        for b in apartment.furniture[:k]:
            gaps = [abs(a.centre[i] - b.centre[i]) - (a.size[i] + b.size[i]) / 2 for i in (0, 1)]
            assert max(gaps) >= 0.95 - 1e-9


def test_exploration_finds_all_furniture_without_being_told() -> None:
    apartment = make_apartment(TASKS["move_toy"], 3)
    world = FastWorld(apartment, (), NOTHING_FAILS, 3)
    scene = SceneMap(world)
    explore(world, scene)
    assert sorted(f.label for f in scene.furniture.values()) == sorted(f.label for f in apartment.furniture)


def test_exploration_ends_when_enough_is_known() -> None:
    world = FastWorld(make_apartment(TASKS["move_toy"], 3), (), NOTHING_FAILS, 3)
    scene = SceneMap(world)
    assert explore(world, scene, lambda: True) == 0 and world.metres == 0
    assert 0 < explore(world, scene, lambda: len(scene.furniture) >= 3) < explore(world, scene)


def test_distances_are_those_of_the_plane_and_go_around_walls() -> None:
    free = np.ones((41, 41), bool)
    found = distances(free, np.ones(free.shape), 20, 20)
    rows, columns = np.mgrid[:41, :41]
    straight = np.hypot(rows - 20, columns - 20)
    assert np.all(found >= straight - 1e-9) and np.max(found - straight) < 1.6  # first order: worst along diagonals
    free[:40, 25] = False
    around = distances(free, np.ones(free.shape), 20, 20)
    assert around[20, 30] > 20 and not np.isfinite(around[5, 25])


def test_a_cause_persists_and_is_nested_in_higher_rates() -> None:
    luck = Luck(7)
    keys = [("cause", k) for k in range(2000)]
    low, high = ({k for k in keys if luck.happens(rate, *k)} for rate in (0.1, 0.3))
    assert low < high and low == {k for k in keys if Luck(7).happens(0.1, *k)}
    assert abs(len(low) / 2000 - 0.1) < 0.03


def test_rates_give_the_printed_counts_over_the_assumed_executions() -> None:
    rates = Rates()
    assert (rates.base + rates.slip) * GRASPS == pytest.approx(COUNTS["grasp"])
    assert (rates.shut + rates.roll) * PLACES == pytest.approx(COUNTS["place"])
    printed = PrintedEyes()
    assert (rates.eyes.missed, rates.eyes.wrong_name, rates.eyes.name_alike.other_region) == pytest.approx(
        (printed.missed, printed.wrong_name, printed.other_region), rel=0.01
    )
    assert rates.api * EXECUTIONS == pytest.approx(COUNTS["api"])
    assert sum(direct for direct, _ in TABLE_3_4.values()) == 14


def test_what_failed_fails_again_until_something_changes() -> None:
    """The same grasp slips for ever unless the thing lies anew; a bad base pose stays bad; another view shows more."""
    apartment = make_apartment(TASKS["place_fruit"], 1)
    sure = Rates(segmenter_rates("thesis").times(0.0), slip=1.0, base=0.0)
    fruit = next(t for t in apartment.things if t.label in ("apple", "banana", "orange", "lemon"))
    world = FastWorld(apartment, (fruit.label,), sure, 1)
    at = (*fruit.at, 0.76)
    before = world.bodies[fruit.name].moved
    assert world.grasp(at, fruit.label, 0).ok and world.held is None  # a slip is not felt
    assert world.bodies[fruit.name].moved == before + 1
    stuck = FastWorld(apartment, (fruit.label,), Rates(base=1.0), 1)
    assert [stuck.grasp(at, fruit.label, k).ok for k in range(3)] == [False] * 3
    assert [e.replanned for e in stuck.events] == [False, True, True]
    again = FastWorld(apartment, (fruit.label,), Rates(replace(segmenter_rates("thesis"), wrong_name=0.5)), 1)
    assert again.look(at, close=True).detections == again.look(at, close=True).detections


BOX = Furniture(name="table_0", label="table", centre=(2, 2), size=(1, 1), height=0.7)
CUP = Thing(name="cup_0", label="cup", on="table_0", at=(2, 2))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"furniture": (BOX, BOX)}, "two things"),
        ({"things": (CUP.model_copy(update={"on": "moon"}),)}, "carries nothing"),
        ({"things": (CUP.model_copy(update={"on": "b", "carries": True, "name": "a"}),
                     CUP.model_copy(update={"on": "a", "carries": True, "name": "b"}))}, "carries itself"),
        ({"start": (9.0, 9.0, 0.0)}, "in no room"),
        ({"rooms": ()}, "at least 1"),
    ],
)  # fmt: skip
def test_apartments_that_do_not_fit_together_are_refused(changes: dict[str, object], words: str) -> None:
    whole = {
        "rooms": (Room(name="r", low=(0, 0), high=(4, 4)),),
        "furniture": (BOX,),
        "things": (CUP,),
        "start": (1, 1, 0),
    }
    Apartment.model_validate(whole)
    with pytest.raises(ValidationError, match=words):
        Apartment.model_validate(whole | changes)


def test_the_base_stays_where_a_pose_is_not_free() -> None:
    apartment = Apartment(rooms=(Room(name="r", low=(0, 0), high=(4, 4)),), furniture=(BOX,), start=(1, 1, 0))
    world = FastWorld(apartment, (), NOTHING_FAILS, 0)
    assert not world.drive(Base(2.0, 2.0, 0.0), "table").ok and world.base == Base(1, 1, 0)
    assert not world.drive(Base(9.0, 9.0, 0.0), "").ok and world.drive(Base(3.2, 1.0, 0.0), "").ok


def test_a_base_prefers_room_to_turn() -> None:
    walls = [(i, j) for i in range(-12, 13) for j in range(-12, 13) if max(abs(i), abs(j)) == 12]
    walls += [(0, j) for j in (*range(-12, -8), *range(3, 12))]
    free = np.array([(i, j) for i in range(-11, 12) for j in range(-11, 12)])
    sweep = Sweep(free, np.array(walls), ())
    bold, careful = ObstacleMap(Base(-0.8, 0, 0), 2.9), ObstacleMap(Base(-0.8, 0, 0), 2.9, 4.5)
    nearest = {}
    for name, there in (("bold", bold), ("careful", careful)):
        there.add(sweep)
        way = there.path(Base(-0.6, -0.6, 0), (0.6, -0.6))
        assert way is not None
        nearest[name] = min(np.hypot(x - 0.1 * i, y - 0.1 * j) for x, y in way[1:-1] for i, j in walls)
    assert nearest["careful"] > nearest["bold"]
    assert careful.at_ease(-0.6, -0.2) and not careful.at_ease(-0.3, -0.8)

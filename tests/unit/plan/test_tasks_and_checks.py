"""Goals of tidying a desk in their order, and whether a thing that lies aslant rests on its support."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.simulation.world import PhysicsWorld, load_scene
from scenewright.stages.plan.checks import CONTACT_HEIGHT, check_on
from scenewright.stages.plan.tasks import MOST_GOALS, SceneFacts, task_goals, tidy_the_desk

from tests.unit.simulation.handmade_scene import HandmadeBody, floor, table, write_scene

# --- tidying a desk -------------------------------------------------------------------------------------------


def office(things: str, targets: dict[str, float], *fits: str) -> SimpleNamespace:
    """A model of a desk at the origin with things on it, and shelves so far away [m]; `fits` are `thing>shelf`."""
    classes = {"desk_1": "desk"} | {name: name.rsplit("_", 1)[0] for name in targets} | dict.fromkeys(things, "cup")
    away = dict.fromkeys(classes, 0.0) | targets
    model = SimpleNamespace(
        records={name: SimpleNamespace(class_name=kind, joints=()) for name, kind in classes.items()},
        pose=lambda name: transform_from_yaw(0.0, np.array([away[name], 0.0, 0.0])),
    )
    atoms = {("reachable", name) for name in classes} | {("on", name, "desk_1") for name in things}
    atoms |= {(word, name) for name in things for word in ("graspable", "clear")}
    atoms |= {("fits", *pair.split(">")) for pair in fits}
    return SimpleNamespace(model=model, atoms=frozenset(atoms))


def goals(things: str, targets: dict[str, float], *fits: str) -> list[str]:
    """The goals in short: `a>shelf_2 b>shelf_2`."""
    found = office(things, targets, *fits)
    literals = tidy_the_desk(SceneFacts(found.model, found.atoms))
    return [" ".join(text.removeprefix("on(").rstrip(")").replace(", ", ">") for text in goal) for goal in literals]


def all_fit(things: str, *targets: str) -> list[str]:
    return [f"{thing}>{target}" for thing in things for target in targets]


def test_all_onto_one_shelf_then_half_onto_each_of_the_two_best_then_the_others() -> None:
    away = {"shelf_2": 2.0, "wall_shelf_3": 1.0, "cabinet_4": 0.5}
    assert goals("ab", away, *all_fit("ab", *away)) == [
        "a>wall_shelf_3 b>wall_shelf_3",  # the nearest shelf
        "a>shelf_2 b>shelf_2",
        "a>wall_shelf_3 b>shelf_2",
        "a>shelf_2 b>wall_shelf_3",
        "a>cabinet_4 b>cabinet_4",  # shelves before cabinets
    ]


def test_of_three_things_two_go_to_the_one_or_to_the_other() -> None:
    away = {"shelf_2": 1.0, "shelf_3": 2.0}
    assert goals("abc", away, *all_fit("abc", *away))[2:] == [
        "a>shelf_2 b>shelf_3 c>shelf_2",
        "a>shelf_3 b>shelf_2 c>shelf_3",
    ]


def test_the_shelf_that_takes_most_comes_first_and_nothing_is_shared_with_one_that_takes_less() -> None:
    away = {"shelf_2": 1.0, "shelf_3": 2.0}
    assert goals("ab", away, "a>shelf_2", *all_fit("ab", "shelf_3")) == ["a>shelf_3 b>shelf_3", "a>shelf_2"]


@pytest.mark.parametrize(
    ("things", "away", "expected"),
    [
        ("a", {"shelf_2": 1.0, "shelf_3": 2.0}, ["a>shelf_2", "a>shelf_3"]),  # one thing is not shared
        ("ab", {"shelf_2": 1.0}, ["a>shelf_2 b>shelf_2"]),  # nor are two with one shelf
    ],
)
def test_nothing_to_share(things: str, away: dict[str, float], expected: list[str]) -> None:
    assert goals(things, away, *all_fit(things, *away)) == expected


def test_no_more_goals_than_allowed_and_none_without_room() -> None:
    away = {f"shelf_{number}": float(number) for number in range(2, 9)}
    found = office("ab", away, *all_fit("ab", *away))
    most = task_goals("tidy-the-desk", found.model, found.atoms)
    assert len(most) == MOST_GOALS and len(set(most)) == MOST_GOALS
    with pytest.raises(MotionFailed, match="nothing small") as raised:
        goals("ab", away)
    assert raised.value.failure.numbers == {"desks": 1.0, "shelves": 7.0}


# --- what rests on what ---------------------------------------------------------------------------------------

REACH, BREADTH, THICKNESS = 0.12, 0.06, 0.02


@pytest.fixture
def room(tmp_path: Path) -> Iterator[PhysicsWorld]:
    """A table, and a thing of two crossed bars (along x and z): turned by 45 degrees it stands on two of its ends."""
    cross = HandmadeBody(
        "jack_9",
        "toy",
        transform_from_yaw(0.0, np.array([0.0, 0.0, 1.0])),
        [((0, 0, 0), (2 * REACH, BREADTH, THICKNESS)), ((0, 0, 0), (THICKNESS, BREADTH, 2 * REACH))],
        "table_3",
        movable=True,
        mass=0.2,
    )
    write_scene(tmp_path, [floor(), table(0.0, 0.0), cross])
    with load_scene(tmp_path) as world:
        yield world


def aslant(height: float) -> np.ndarray:
    """Turned by 45 degrees about y, its lowest corners at a height [m]."""
    pose = np.eye(4)
    share = np.sqrt(0.5)
    pose[:3, :3] = [[share, 0.0, share], [0.0, 1.0, 0.0], [-share, 0.0, share]]
    pose[:3, 3] = [0.1, 0.0, height + share * (REACH + THICKNESS / 2)]
    return pose


def test_what_lies_aslant_rests_where_its_shapes_do(room: PhysicsWorld) -> None:
    """Its axis-aligned bounds reach through the table top: what rests is told by its corners."""
    room.set_pose("jack_9", aslant(0.751))
    room.step(240)
    check = check_on(room, "on(jack_9, table_3)", "jack_9", "table_3")
    assert check.holds, check.detail
    assert check.numbers["height"] == pytest.approx(0.75, abs=0.002)
    assert check.numbers["gap"] == pytest.approx(0.0, abs=0.002)
    assert room.bounds("jack_9")[0][2] < 0.75 - CONTACT_HEIGHT, "else its bounds would do"


def test_what_hovers_aslant_does_not_rest_though_its_bounds_touch(room: PhysicsWorld) -> None:
    room.set_pose("jack_9", aslant(0.78))
    room.step(1)
    assert room.bounds("jack_9")[0][2] < 0.75
    check = check_on(room, "on(jack_9, table_3)", "jack_9", "table_3")
    assert not check.holds and "gap" not in check.numbers
    assert "its lowest point is at 0.780 m" in check.detail


def test_what_hangs_over_the_edge_with_its_middle_is_not_on_it(room: PhysicsWorld) -> None:
    """Upright on one end of a bar, its middle just beyond the outline; caught at the moment of contact."""
    pose = aslant(0.7499)
    pose[0, 3] = 0.605
    room.set_pose("jack_9", pose)
    room.step(1)
    check = check_on(room, "on(jack_9, table_3)", "jack_9", "table_3")
    assert check.numbers["contacts"] > 0 and not check.holds and "outside its outline" in check.detail

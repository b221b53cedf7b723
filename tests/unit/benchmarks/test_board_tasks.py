"""Tasks of the board: drawn from the true room, carried by matching, judged by the true room's end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.plan import PlanFile
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.kit.motion.doors import body_from_moved
from scenewright.stages.kit.motion.recording import Snapshot
from scenewright.stages.plan.execution_log import write_execution
from scenewright.stages.plan.pictures import picture_camera

from benchmarks.board.records import Line, Trial
from benchmarks.board.tasks import running
from benchmarks.board.tasks.carrying import Counterparts, carry, one_to_one
from benchmarks.board.tasks.drawing import Task, draw_tasks, load_tray
from benchmarks.board.tasks.figures import failure_counts, task_shares
from benchmarks.board.tasks.measuring import records_of, told_of
from benchmarks.board.tasks.room_facts import RoomFacts, room_facts
from benchmarks.board.tasks.running import TaskRecord
from benchmarks.board.tasks.true_end import Ending, read_ending, which_hold
from benchmarks.experiments import plan_true_rooms
from tests.unit.simulation.handmade_scene import HandmadeBody, kitchen, table, write_scene

FAR = 3.0


def thing(name: str, x: float, y: float, parent: str = "table_3", height: float = 0.1) -> HandmadeBody:
    """A small box on a table 0.75 m high."""
    boxes = [((0.0, 0.0, height / 2), (0.07, 0.07, height))]
    pose = transform_from_yaw(0.0, np.array([x, y, 0.75]))
    return HandmadeBody(name, name.split("_")[0], pose, boxes, parent, movable=True, mass=0.2, grasp_width=0.07)


def tray() -> HandmadeBody:
    """A tray 30 cm x 20 cm on the table."""
    pose = transform_from_yaw(0.0, np.array([-1.0, -1.2, 0.75]))
    boxes = [((0.0, 0.0, 0.01), (0.3, 0.2, 0.02))]
    return HandmadeBody(
        "tray_9", "tray", pose, boxes, "table_3", movable=True, mass=0.3, supports=[(0, 0, 0.02, 0.3, 0.2)]
    )


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("room")
    others = [thing("can_6", -1.0, -0.75), tray(), table(FAR, 0.0, "table_8")]
    write_scene(root, [*kitchen(door_value=1.6), *others])
    return root


def facts_of(room: Path, unseen: str = "") -> RoomFacts:
    graph = ContactGraphFile.read(room / "graph.json")
    return room_facts(room, graph, [node.id for node in graph.nodes if node.id != unseen])


def goals(tasks: Iterator[Task] | tuple[Task, ...]) -> set[tuple[str, ...]]:
    return {task.goal for task in tasks}


# --- drawing --------------------------------------------------------------------------------------------------


def test_tasks_are_drawn_by_seed_and_none_holds_at_the_beginning(room: Path) -> None:
    facts = facts_of(room)
    drawn = draw_tasks(facts, 7)
    assert drawn == draw_tasks(facts, 7) and len(drawn) == 5
    assert any(draw_tasks(facts, seed) != drawn for seed in range(8, 12))
    assert len(goals(drawn)) == 5
    wanted = sorted({literal for task in drawn for literal in task.goal})
    assert not any(which_hold(room, Ending(), wanted))


def test_a_task_names_only_what_was_seen_and_what_the_hand_takes(room: Path) -> None:
    every = {name for seed in range(6) for task in draw_tasks(facts_of(room, "can_6"), seed) for name in task.goal}
    assert not any("can_6" in literal for literal in every)
    assert {thing.name for thing in facts_of(room).things} == {"bottle_7", "cup_5", "can_6"}


def test_furniture_that_stands_open_is_to_be_shut_and_furniture_that_is_shut_to_stay_so(tmp_path: Path) -> None:
    for value, of_goal in ((1.6, True), (0.0, False)):
        root = tmp_path / str(value)
        write_scene(root, kitchen(door_value=value))
        (task,) = {task for seed in range(3) for task in draw_tasks(facts_of(root), seed) if task.kind == "take_out"}
        shut = ("closed(fridge_2)",)
        assert (
            (task.goal, task.keeps) == (("on(bottle_7, table_3)", *shut), ())
            if of_goal
            else (("on(bottle_7, table_3)",), shut)
        )


def test_two_things_go_onto_a_tray_where_both_have_room(room: Path) -> None:
    assert goals(load_tray(facts_of(room))) == {("on(can_6, tray_9)", "on(cup_5, tray_9)")}
    facts = facts_of(room)
    wide = tuple(replace(thing, radius=0.08) for thing in facts.things)
    assert not goals(load_tray(replace(facts, things=wide)))


def test_a_place_that_is_taken_is_no_place(room: Path) -> None:
    facts = facts_of(room)
    cup = next(thing for thing in facts.things if thing.name == "cup_5")
    assert facts.fits(cup, "table_8", inside=False) and facts.fits(cup, "fridge_2", inside=True)
    full = {**facts.footprints, "box_1": np.array([FAR, 0.0, 0.0, 0.6, 0.35, 0.75, 0.9])}
    assert not replace(facts, footprints=full).fits(cup, "table_8", inside=False)
    assert not facts.fits(replace(cup, height=0.4), "fridge_2", inside=True)


# --- carrying -------------------------------------------------------------------------------------------------


def counterparts(room: Path, **found: str) -> Counterparts:
    bodies = InteractiveSceneFile.read(room / "scene.json").bodies
    return Counterparts(found, {body.name: body for body in bodies})


def test_true_things_and_entities_are_paired_one_to_one() -> None:
    overlaps = {(1, 10): 0.9, (2, 10): 0.5, (2, 11): 0.3, (3, 12): 0.2}
    assert one_to_one(overlaps, [1, 2, 3], [10, 11, 12], 0.25) == {1: 10, 2: 11}
    assert one_to_one({}, [1], [], 0.25) == {}


def test_a_task_is_carried_as_far_as_the_map_has_its_things(room: Path) -> None:
    task = Task("clear", ("on(can_6, table_8)", "on(cup_5, table_8)"))
    known = counterparts(room, cup_5="bottle_7", table_8="table_3")
    carried = carry(task, known)
    assert carried.literals == ("on(bottle_7,table_3)",) and carried.lacking == ("can_6",)


def test_what_serves_otherwise_than_needed_is_not_asked_for(room: Path) -> None:
    task = Task("put_in", ("in(cup_5, fridge_2)",), ("closed(fridge_2)",))
    carried = carry(task, counterparts(room, cup_5="cup_5", fridge_2="table_3"))
    assert carried.literals == () and carried.lacking == ()
    nailed = carry(Task("move", ("on(cup_5, table_8)",)), counterparts(room, cup_5="fridge_2", table_8="table_3"))
    assert nailed.literals == ()
    kept = carry(task, counterparts(room, fridge_2="fridge_2"))  # what holds already is no task
    assert kept.literals == () and kept.lacking == ("cup_5",)


# --- judging --------------------------------------------------------------------------------------------------


def at(x: float, y: float, z: float) -> np.ndarray:
    return transform_from_yaw(0.0, np.array([x, y, z]))


def hinge(room: Path) -> tuple[Joint, np.ndarray]:
    record = next(body for body in InteractiveSceneFile.read(room / "scene.json").bodies if body.name == "fridge_2")
    return record.joints[0], np.array(record.world_from_body)


def door_at(room: Path, value: float) -> dict[str, np.ndarray]:
    """The world pose of the fridge's door, whose link has its origin in the hinge."""
    joint, world_from_body = hinge(room)
    own = np.eye(4)
    own[:3, 3] = joint.origin
    return {joint.part: world_from_body @ body_from_moved(joint, value) @ own}


def test_a_thing_left_behind_fails_its_literal(room: Path) -> None:
    end = Ending({"cup_5": at(FAR, 0.0, 0.75)})
    assert which_hold(room, end, ("on(cup_5, table_8)", "on(can_6, table_8)")) == (True, False)


@pytest.mark.parametrize(
    ("pose", "speed", "holds"),
    [
        (at(FAR, 0.0, 0.75), 0.0, True),
        (at(FAR, 0.0, 0.7505), 0.0, True),
        (at(FAR, 0.0, 0.78), 0.0, False),  # in the hand, over the table
        (at(FAR, 0.0, 0.0), 0.0, False),  # on the floor below it
        (at(FAR + 0.62, 0.0, 0.75), 0.0, False),  # over its edge
        (at(FAR, 0.0, 0.75), 0.1, False),  # rolling
    ],
)
def test_on_means_resting_on_it(room: Path, pose: np.ndarray, speed: float, holds: bool) -> None:
    assert which_hold(room, Ending({"cup_5": pose}, {"cup_5": speed}), ("on(cup_5, table_8)",)) == (holds,)


def test_in_means_touching_it_within_its_bounds_and_shut_is_read_off_the_door(room: Path) -> None:
    inside = {"cup_5": at(1.0, 1.5, 0.45)}
    literals = ("in(cup_5, fridge_2)", "closed(fridge_2)")
    assert which_hold(room, Ending(inside | door_at(room, 0.02)), literals) == (True, True)
    assert which_hold(room, Ending(inside | door_at(room, 0.9)), literals) == (True, False)
    assert which_hold(room, Ending(inside), literals) == (True, False)  # where the door was
    assert which_hold(room, Ending({"cup_5": at(1.0, 1.5, 1.4)}), literals[:1]) == (False,)  # on its top


def test_the_end_is_read_off_the_log(tmp_path: Path) -> None:
    path = [at(0.0, 0.0, 0.1 * step) for step in range(4)]
    snapshots = [
        Snapshot(0.1 * step, 0, np.zeros(10), 0.0, {"cup_5": pose, "can_6": path[min(step, 1)]})
        for step, pose in enumerate(path)
    ]
    snapshots += [replace(snapshots[-1], time=0.35)]
    write_execution(tmp_path / "execution.mcap", snapshots, {}, picture_camera(64), np.eye(4))
    end = read_ending(tmp_path / "execution.mcap")
    np.testing.assert_allclose(end.poses["cup_5"], path[-1], atol=1e-6)
    np.testing.assert_allclose(end.poses["can_6"], path[1], atol=1e-6)
    assert end.speeds["cup_5"] == pytest.approx(1.0, rel=1e-3)


# --- figures --------------------------------------------------------------------------------------------------


def record(room: str, holds: tuple[bool, ...], failure: str = "", lacking: tuple[str, ...] = ()) -> TaskRecord:
    goal = tuple(f"on(cup_{number}, table_8)" for number, _ in enumerate(holds))
    return TaskRecord(
        room, 0, "move", "camera", goal, (), goal, lacking, holds, not failure, "executed", failure, 4, 9.0
    )


def test_shares_are_by_room_and_what_the_map_lacks_is_no_success() -> None:
    records = [
        record("a", (True, True)),
        record("a", (True, False), "not_in_map", ("can_6",)),
        record("b", (False,), "no_path"),
        record("c", (False,), "not_in_map", ("cup_5",)),
    ]
    shares = task_shares(records)
    assert shares["camera/success"].by_room == {"a": 0.5, "b": 0.0, "c": 0.0}
    assert shares["camera/success"].value == pytest.approx(1 / 6)
    assert (shares["camera/literals"].hits, shares["camera/literals"].tries) == (3, 6)
    assert shares["camera/success in the map"].by_room == {"a": 1.0, "b": 0.0}
    assert failure_counts(records) == {"camera": {"not_in_map": 2, "no_path": 1}}


def test_a_line_of_a_room_holds_the_records_of_its_tasks() -> None:
    records = [record("a", (True, True)), replace(record("a", (False,), "not_in_map", ("can_6",)), task=1)]
    told = told_of(records, {"fuse": 5.0})
    assert told["figures"]["success"] == 0.5 and told["figures"]["failed by not_in_map"] == 1.0
    assert told["seconds"] == {"fuse": 5.0, "plan": 18.0}
    who = {
        "key": "0",
        "commit": "0",
        "digest": "0",
        "clean": True,
        "board": "0",
        "day": "2026-11-29",
        "committed": "",
        "judge": "",
    }
    line = Line.model_validate({"trial": Trial(part="tasks", case="camera", seed="a", arm="ours"), **who, **told})
    assert records_of([line]) == records


def test_nothing_measured_is_no_figure() -> None:
    shares = task_shares([record("a", (False,), "not_in_map", ("cup_5",))])
    assert shares["camera/success in the map"].value is None


# --- a perfect map --------------------------------------------------------------------------------------------


def test_where_the_map_is_the_true_room_a_task_is_asked_for_as_it_is(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth = tmp_path / "truth"
    truth.mkdir()
    (truth / "room").symlink_to(room)
    asked: list[tuple[str, ...]] = []

    def planned(name, out, given, *, seed, scene, ground_truth):  # type: ignore[no-untyped-def]
        assert (name, given["eyes"], given["robot"]) == ("plan", "true", "ur5e")
        assert (scene.root, ground_truth.root) == (truth / "room", truth)
        asked.append(given["goal"])
        out.mkdir(parents=True)
        plan = PlanFile(goal=given["goal"], planned_in="reconstructed", executed_in=None, actions=(), status="planned")
        plan.write(out / "plan.json")

    monkeypatch.setattr(running, "facts_of", lambda path: facts_of(room))
    monkeypatch.setattr(running, "opened", lambda kind, path: kind(path))
    monkeypatch.setattr(running, "unrecorded", planned)
    records = list(running.run_true_room(running.TaskRoom("room-7", truth, 7), tmp_path / "scratch", "true", "ur5e"))
    assert [record.asked for record in records] == asked == [record.goal + record.keeps for record in records]
    assert {(record.status, record.success, record.failure) for record in records} == {
        ("planned", False, running.SOMETHING_ELSE)
    }
    of_moves = plan_true_rooms.of_kind("move", plan_true_rooms.RoomTasks(tuple(records)))
    assert of_moves is not None and {record.kind for record in of_moves.tasks} == {"move"}

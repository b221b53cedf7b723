"""Rooms of the chain: learning in them, planning in a scene with what was learned, a person as the teacher."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenewright.cli.main import run as run_command
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, ScenewrightError
from scenewright.stages.kit.predicates.room import Body, RoomState
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan.given_domain import read_given_domain
from scenewright.stages.plan.reading import Reading
from scenewright.stages.plan.symbols import symbolic_state
from scenewright.stages.plan.world_model import WorldModel
from scenewright.stages.predicates.room.tasks import read_rooms, room_tasks
from scenewright.stages.predicates.room.world import RoomWorld
from scenewright.stages.predicates.teacher.terminal import Asked, TerminalTeacher, read_dialogue
from scenewright.stages.predicates.truth import truth_of

from tests.unit.plan.conftest import kitchen_model, model, scene  # noqa: F401


def box(x: float, z: float, edge: float, category: str, **rest: float) -> Body:
    return Body((x, 0.0, z), (edge, edge, edge), edge, edge, category, **rest)  # type: ignore[arg-type]


ROOM = RoomState(
    {
        "cup_1": box(0.0, 0.55, 0.07, "cup"),
        "book_2": box(0.2, 0.53, 0.05, "book", surface=0.02),
        "table_3": box(0.0, 0.25, 0.5, "table", surface=0.25),
        "fridge_4": box(2.0, 0.5, 1.0, "fridge", doors=1),
    },
    {"cup_1": "table_3", "book_2": "table_3"},
)


def test_actions_move_boxes_and_say_why_they_fail() -> None:
    world = RoomWorld(ROOM, 0)
    assert "is not in the hand" in world.do(("place", "cup_1", "table_3"))
    assert "wider" in world.do(("pick", "table_3"))
    assert world.do(("pick", "cup_1")) == "" and world.state().held == "cup_1"
    assert "hand is full" in world.do(("open", "fridge_4"))
    assert "not open" in world.do(("put_in", "cup_1", "fridge_4"))
    assert world.do(("place", "cup_1", "book_2")) == ""
    atoms = truth_of("room").atoms(world.state())
    assert {("on", "cup_1", "book_2"), ("stacked", "cup_1")} <= atoms and ("clear", "book_2") not in atoms
    assert "something stands" in world.do(("pick", "book_2"))
    assert world.do(("open", "fridge_4")) == "" and world.do(("pick", "cup_1")) == ""
    assert world.do(("put_in", "cup_1", "fridge_4")) == "" and world.do(("close", "fridge_4")) == ""
    assert ("accessible", "cup_1") not in truth_of("room").atoms(world.state())
    assert "is shut" in world.do(("pick", "cup_1"))


@pytest.fixture(scope="module")
def learned(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:  # noqa: F811
    out = tmp_path_factory.mktemp("room") / "learned"
    words = ["predicates", "teach", "--scene", str(scene), "--tasks", "12", "--seed", "3", "--out", str(out), "--quiet"]
    assert run_command(words) == 0
    return out


def test_what_was_learned_in_a_room_is_planned_with(model: WorldModel, scene: Path, learned: Path) -> None:  # noqa: F811
    reading = Reading(read_given_domain(learned))
    graph = ContactGraphFile.read(scene / "graph.json")
    objects, initial = symbolic_state(model, graph)
    (literals, *_) = reading.candidates(model, graph, objects, initial, ("put bottle_7 on table_3",))
    problem, actions = reading.task(model, reading.problem(model, graph, objects, initial, literals))
    plan = plan_task(problem, actions)
    assert plan.actions is not None
    steps = [action.text for action in plan.actions if action.name != "drive"]
    assert steps == ["take_out(bottle_7, fridge_2, fridge_2__hinge)", "place(bottle_7, table_3)"]
    check = reading.check(model, graph, literals[0])
    assert check is not None and not check.holds
    assert reading.check(model, graph, f"not {literals[0]}").holds  # type: ignore[union-attr]


def test_it_is_tried_in_rooms_and_not_in_the_kitchen(scene: Path, learned: Path, tmp_path: Path) -> None:  # noqa: F811
    given = ["--learned", str(learned), "--quiet"]
    out = tmp_path / "rooms"
    assert run_command(["predicates", "evaluate", *given, "--scene", str(scene), "--out", str(out)]) == 0
    (row,) = json.loads((out / "results.json").read_text())["rows"]
    assert row["tasks"] == row["ceiling"] == 10 and row["reached"] >= 5
    assert run_command(["predicates", "evaluate", *given, "--out", str(tmp_path / "none")]) == 3
    assert run_command(["predicates", "plan", *given, "--out", str(tmp_path / "none")]) == 3
    assert not (tmp_path / "none").exists()


def test_rooms_without_things_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no scene.json"):
        read_rooms(tmp_path, "panda")
    with pytest.raises(BadInput, match="no goal was found"):
        room_tasks([RoomState({"cup_1": ROOM.bodies["cup_1"]})], 1, 0)


def test_another_robot_reaches_and_grips_otherwise(scene: Path) -> None:  # noqa: F811
    (panda,), (gen3,) = read_rooms(scene, "panda"), read_rooms(scene, "kinova_gen3")
    assert (panda.hand_opening, gen3.hand_opening) == (0.08, 0.085)
    assert panda.bodies == gen3.bodies and panda.reach != gen3.reach


def test_a_robot_that_is_none_or_has_no_room_is_refused(scene: Path, tmp_path: Path) -> None:  # noqa: F811
    words = ["predicates", "teach", "--out", str(tmp_path / "out"), "--quiet", "--robot"]
    assert run_command([*words, "r2d2", "--scene", str(scene)]) == 2
    assert run_command([*words, "ur5e"]) == 2
    assert not (tmp_path / "out").exists()


# --- a person as the teacher ----------------------------------------------------------------------------------


def answers(state: RoomState) -> list[Asked]:
    said = []
    for question, answer in (
        ("May I pick cup_1?", "Yes."),
        ("May I open table_3?", "perhaps"),
        ("May I open table_3? (yes or no)", "no"),
        ("Why can't I open table_3? (a sentence; say `object NAME` for objects)", "object table_3 has no door"),
    ):
        said.append(Asked(question=question, answer=answer))
    return said


def ask(teacher: TerminalTeacher) -> tuple[bool, bool, str]:
    first = teacher.allows(ROOM, ("pick", "cup_1"))
    return first, teacher.allows(ROOM, ("open", "table_3")), teacher.correct(ROOM, ("open", "table_3"))


def test_a_dialogue_is_kept_and_replays_to_the_same_bytes(tmp_path: Path) -> None:
    live = iter(each.answer for each in answers(ROOM))
    log = tmp_path / "teacher.jsonl"
    said = ask(TerminalTeacher("room", [], log, lambda question: next(live)))
    assert said == (True, False, "object table_3 has no door")
    again = tmp_path / "again.jsonl"
    assert ask(TerminalTeacher("room", read_dialogue(log), again, None)) == said
    assert again.read_bytes() == log.read_bytes()


def test_a_dialogue_that_does_not_fit_is_refused_in_one_line(tmp_path: Path) -> None:
    cut = TerminalTeacher("room", answers(ROOM)[:1], tmp_path / "log", None)
    with pytest.raises(ScenewrightError, match="ends before question 2") as refused:
        ask(cut)
    assert "\n" not in str(refused.value) and (tmp_path / "log").read_text().count("\n") == 1
    with pytest.raises(BadInput, match="was asked then"):
        ask(TerminalTeacher("room", answers(ROOM)[1:], tmp_path / "log2", None))
    torn = tmp_path / "torn.jsonl"
    torn.write_text('{"question": "May I", "ans')
    with pytest.raises(BadInput, match="line 1"):
        read_dialogue(torn)


def test_without_a_terminal_nobody_is_asked(tmp_path: Path) -> None:
    words = ["predicates", "teach", "--teacher", "terminal", "--out", str(tmp_path / "none"), "--quiet"]
    assert run_command(words) == 2


def test_a_whole_lesson_replays(tmp_path: Path) -> None:
    """What a simulated person would answer, as a dialogue: the artifact is the same when it is replayed."""
    from scenewright.stages.predicates.learning.memory import Memory
    from scenewright.stages.predicates.learning.ours import OursLearner
    from scenewright.stages.predicates.learning.records import document_of
    from scenewright.stages.predicates.learning.setting import ROOM as SETTING
    from scenewright.stages.predicates.room.tasks import open_room
    from scenewright.stages.predicates.teacher.simulated import SimulatedTeacher
    from scenewright.stages.predicates.training import train

    tasks = room_tasks([ROOM], 3, 1)
    truth = SimulatedTeacher("room", 1)

    class Person(TerminalTeacher):
        """Knows what the simulated teacher knows, and types it."""

        def allows(self, state, action):  # type: ignore[no-untyped-def]
            self._ask = lambda question: "yes" if truth.allows(state, action) else "no"
            return super().allows(state, action)

        def correct(self, state, action):  # type: ignore[no-untyped-def]
            self._ask = lambda question: truth.correct(state, action)
            return super().correct(state, action)

        def satisfied(self, state, goal):  # type: ignore[no-untyped-def]
            self._ask = lambda question: "yes" if truth.satisfied(state, goal) else "no"
            return super().satisfied(state, goal)

        def unmet(self, state, goal):  # type: ignore[no-untyped-def]
            self._ask = lambda question: truth.unmet(state, goal)
            return super().unmet(state, goal)

        def answer(self, state, phrase, objects):  # type: ignore[no-untyped-def]
            self._ask = lambda question: "yes" if truth.answer(state, phrase, objects) else "no"
            return super().answer(state, phrase, objects)

    def lesson(teacher: TerminalTeacher) -> bytes:
        memory = Memory(SETTING)
        training = train(OursLearner(teacher, tuple(SETTING.arity), 1, memory), "room", tasks, open_room)
        assert training.reached
        document = document_of(memory, domain="room", teacher=teacher.label, physics=(), statement="")
        return document.model_dump_json().encode()

    first = lesson(Person("room", [], tmp_path / "first.jsonl", lambda question: ""))
    again = lesson(TerminalTeacher("room", read_dialogue(tmp_path / "first.jsonl"), tmp_path / "again.jsonl", None))
    assert first == again
    assert (tmp_path / "first.jsonl").read_bytes() == (tmp_path / "again.jsonl").read_bytes()

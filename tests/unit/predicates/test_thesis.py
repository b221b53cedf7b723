"""The thesis's learner and the arms that ask a language model, by scripts and transcripts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenewright.cli.main import run as run_command
from scenewright.stages.kit.language.backend import Request
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.recorded import RecordedBackend, RecordingBackend
from scenewright.stages.kit.language.reply_text import objects_in
from scenewright.stages.kit.language.scripted import ScriptedBackend
from scenewright.stages.kit.language.transcripts import TranscriptFile, read_transcript
from scenewright.stages.kit.predicates.expressions import text_of
from scenewright.stages.predicates.execution import Live
from scenewright.stages.predicates.language_arms import code_as_policies, inner_monologue
from scenewright.stages.predicates.learning.operators import Transition
from scenewright.stages.predicates.learning.phrases import Phrase
from scenewright.stages.predicates.learning.synthesis import Label
from scenewright.stages.predicates.learning.thesis import NEVER, ROUNDS, ThesisLearner, stand_in
from scenewright.stages.predicates.learning.thesis_memory import ThesisMemory
from scenewright.stages.predicates.learning.thesis_operators import likelihood, search_operators
from scenewright.stages.predicates.tasks import Task, open_kitchen
from scenewright.stages.predicates.teacher.simulated import SimulatedTeacher

from tests.unit.predicates.test_learning import TABLE

ACTIONS = {"pick_up": 1, "place_on_table": 1, "place_first_on_second": 2}
TASK = Task("store_objects/own/1", {"shelf": (-5.0, 0.0), "fruitcan": (10.0, 0.0)}, (("on", "fruitcan", "shelf"),), 1)


def learner(script) -> ThesisLearner:  # type: ignore[no-untyped-def]
    teacher = SimulatedTeacher("store_objects", 0)
    return ThesisLearner(teacher, tuple(ACTIONS), 0, chat=Chat(ScriptedBackend("test", script)))


def test_the_corrector_mends_at_most_three_times() -> None:
    """The third guess of the script is right; a script that never is leaves its last word, and is asked no more."""
    guesses = iter(["(less 9 (width ?a))", "(less 8.5 (width ?a))", "(less (width ?a) 9)", "(less (width ?a) 5)"])

    def script(request: Request) -> str:
        if "You are the reasoner" in request.messages[0].text:
            return json.dumps({"complaint": "object <1> is odd", "objects": ["shelf"]})
        return json.dumps({"expression": next(guesses)})

    taught = learner(script)
    taught.memory.labels[Phrase("object <1> is odd", 1)].append(Label(0, ("can",), True, "answer"))
    taught.memory.remember(TABLE)
    taught.refused(TABLE, ("pick_up", "shelf"), "object shelf is odd")
    means = taught.memory.meanings[Phrase("object <1> is odd", 1)]
    assert text_of(means) == "(less (width ?a) 5)" and taught.chat.calls == 1 + 1 + ROUNDS


def test_what_nobody_can_write_never_holds_and_says_why() -> None:
    def script(request: Request) -> str:
        if "You are the reasoner" in request.messages[0].text:
            return json.dumps({"complaint": "object <1> is odd", "objects": ["shelf"]})
        return json.dumps({"expression": "(import os)"})

    taught = learner(script)
    taught.refused(TABLE, ("pick_up", "shelf"), "object shelf is odd")
    assert taught.memory.meanings[Phrase("object <1> is odd", 1)] == NEVER
    assert any("there is no `import`" in each for each in taught.unwritten)


@pytest.mark.parametrize("expression", ["(less (over 1 (water ?a)) 2)", "(some ?x (every ?x (less 1 2)))", "(less 1"])
def test_a_division_by_zero_and_the_like_are_refused_not_run(expression: str) -> None:
    def script(request: Request) -> str:
        if "You are the reasoner" in request.messages[0].text:
            return json.dumps({"complaint": "object <1> is odd", "objects": ["can"]})
        return json.dumps({"expression": expression})

    taught = learner(script)
    taught.refused(TABLE, ("pick_up", "can"), "object can is odd")
    assert taught.unwritten and all("\n" not in each for each in taught.unwritten)


def test_each_predicate_has_its_negation() -> None:
    taught = learner(stand_in)
    taught.refused(TABLE, ("pick_up", "shelf"), "object shelf is too large for the gripper to pick up")
    name = next(name for name in taught.memory.used() if name.startswith("no-"))
    seen = taught.memory.see(TABLE)
    assert {(name, "shelf"), (name.removeprefix("no-"), "can")} <= seen


def test_a_literal_is_dropped_unless_effects_get_less_certain() -> None:
    """Weather makes no difference, the lamp does: without it two effects follow one state."""
    lit, dark = frozenset({("lamp", "o"), ("rain", "o"), ("odd", "o")}), frozenset({("no-lamp", "o"), ("odd", "o")})
    seen, done = (
        frozenset({("lamp", "o"), ("odd", "o"), ("seen", "o")}),
        frozenset({("no-lamp", "o"), ("odd", "o"), ("felt", "o")}),
    )
    atoms = [lit, lit | {("seen", "o")}, frozenset({("lamp", "o"), ("odd", "o")}), seen, dark, done]
    transitions = [Transition(("look", "o"), place, place + 1) for place in (0, 2, 4)]
    predicates = dict.fromkeys(("lamp", "no-lamp", "rain", "odd", "seen", "felt"), 1)
    domain = search_operators("d", predicates, transitions, atoms, {"look": frozenset({("odd", "?a")})})
    found = {(schema.preconditions, schema.add) for schema in domain.schemas}
    assert found == {
        ((("lamp", "?a"), ("odd", "?a")), (("seen", "?a"),)),
        ((("no-lamp", "?a"), ("odd", "?a")), (("felt", "?a"),)),
        ((("odd", "?a"), ("rain", "?a")), (("seen", "?a"),)),
    }
    cases = [(frozenset(), frozenset({("p", "?a")}), frozenset()), (frozenset(), frozenset(), frozenset({("p", "?a")}))]
    assert likelihood(frozenset(), cases) < likelihood(frozenset(), cases[:1]) == 0.0


def test_taught_by_a_stand_in_and_again_by_its_transcript(tmp_path: Path) -> None:
    words = ["predicates", "teach", "--learner", "thesis", "--tasks", "2", "--seed", "2", "--quiet"]
    assert run_command([*words, "--out", str(tmp_path / "one")]) == 0
    document = json.loads((tmp_path / "one" / "domain.json").read_text())
    assert document["learner"] == "thesis, scripted:word-list"
    transcript = tmp_path / "one" / "transcript.jsonl"
    again = [*words, "--language", "recorded", "--transcript", str(transcript), "--out", str(tmp_path / "two")]
    assert run_command(again) == 0
    other = json.loads((tmp_path / "two" / "domain.json").read_text())
    assert other["predicates"] == document["predicates"] and other["transitions"] == document["transitions"]


# --- Inner Monologue and Code as Policies ---------------------------------------------------------------------


def replayed(tmp_path: Path, script, run):  # type: ignore[no-untyped-def]
    """Return what `run` gives with a script, after asserting that its transcript gives the same."""
    file = tmp_path / "transcript.jsonl"
    first = run(Chat(RecordingBackend(ScriptedBackend("test", script), TranscriptFile(file), None)))
    transcript = read_transcript(file)
    again = run(Chat(RecordedBackend(transcript, transcript.models[0])))
    assert again == first
    return first


STEPS = [("pick_up", ["fruitcan"]), ("place_first_on_second", ["fruitcan", "shelf"]), ("done", [])]


@pytest.mark.parametrize("kind", ["objects", "scene", "preconditions"])
def test_an_inner_monologue_goes_step_by_step(tmp_path: Path, kind: str) -> None:
    def script(request: Request) -> str:
        given = objects_in(request.messages[1].text)[0]
        assert ("holds" in given) == (kind != "objects")
        action, objects = STEPS[len(given["so far"])]
        return json.dumps({"action": action, "objects": objects})

    memory = ThesisMemory()
    if kind == "preconditions":
        teach(memory)
    found = replayed(
        tmp_path,
        script,
        lambda chat: inner_monologue(TASK, Live(open_kitchen(TASK)), chat, ACTIONS, kind, memory),  # type: ignore[arg-type]
    )
    assert found.success and len(found.steps) == 2


def teach(memory: ThesisMemory) -> None:
    """Let operators be learned of one pick and one place."""
    world = Live(open_kitchen(TASK))
    before = memory.remember(world.state())
    memory.meanings[Phrase("object <1> is not on object <2>", 2)] = ("rests_on", "?a", "?b")
    for action, objects in STEPS[:2]:
        assert world.do((action, *objects)) == ""
        after = memory.remember(world.state())
        memory.transitions.append(Transition((action, *objects), before, after))
        before = after


def test_a_step_that_the_operators_forbid_goes_back_three_times(tmp_path: Path) -> None:
    memory = ThesisMemory()
    teach(memory)
    asked = []

    def script(request: Request) -> str:
        asked.append(request)
        return json.dumps({"action": "place_first_on_second", "objects": ["fruitcan", "shelf"]})

    chat = Chat(ScriptedBackend("test", script))
    found = inner_monologue(TASK, Live(open_kitchen(TASK)), chat, ACTIONS, "preconditions", memory)
    assert not found.success and len(asked) == 4 and not found.steps


@pytest.mark.parametrize(
    ("program", "success", "why"),
    [
        ([("action", *STEPS[0]), ("assert", "in_gripper", ["fruitcan"]), ("action", *STEPS[1])], True, ""),
        ([("assert", "in_gripper", ["fruitcan"]), ("action", *STEPS[1])], False, "asserted in vain"),
        ([("action", "fly", ["fruitcan"])], False, "which there is not"),
        ([("action", *STEPS[1])], False, ""),
    ],
)
def test_a_program_is_carried_out_as_data(tmp_path: Path, program, success: bool, why: str) -> None:  # type: ignore[no-untyped-def]
    lines = [{"do": do, "name": name, "objects": objects} for do, name, objects in program]

    def script(request: Request) -> str:
        return json.dumps({"statements": lines})

    found = replayed(
        tmp_path, script, lambda chat: code_as_policies(TASK, Live(open_kitchen(TASK)), chat, ACTIONS, ThesisMemory())
    )
    assert found.success == success and why in found.unplanned

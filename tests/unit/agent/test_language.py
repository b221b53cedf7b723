"""Programs: what is in the language, what is said of what is not, and that nothing outside it is ever run."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.stages.agent.language.interpreter import Interpreter, Ran
from scenewright.stages.agent.language.program import PlanError, parse_program
from scenewright.stages.agent.language.values import ObjectMap, Outcome, SceneObject, Value

CUPS = ObjectMap((SceneObject("cup_0", "cup", "table_0", "blue"), SceneObject("cup_1", "cup", "table_0", "red")))


def ran(text: str, late: bool = False) -> tuple[Ran, list[tuple[str, tuple[Value, ...]]]]:
    asked: list[tuple[str, tuple[Value, ...]]] = []

    def call(name: str, arguments: tuple[Value, ...]) -> Value:
        asked.append((name, arguments))
        return CUPS if name.startswith("explore") else Outcome(True)

    return Interpreter(call, lambda: late).run(parse_program(text)), asked


def test_a_program_runs_calls_loops_and_conditions() -> None:
    text = """
objects = robot.explore_local()
count = 0
for cup in objects.find("cup", "blue"):
    if cup.color == "blue" and not count and len(objects) == 2:
        if grasp(cup):
            count = 1
print("grasped", count, objects["cup_1"].label)
done()
"""
    result, asked = ran(text)
    assert [name for name, _ in asked] == ["explore_local", "grasp"] and asked[1][1] == (CUPS.objects[0],)
    assert result.error is None and result.printed == ["grasped 1 cup"]
    assert result.ended is not None and result.ended.how == "done"


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        ("pick(1)", "unknown_call", "did you mean grasp(object)"),
        ("graps(1)", "unknown_call", "did you mean grasp(object)"),
        ('navigate("table_0")', "wrong_arguments", "navigate(text) cannot be called; did you mean navigate(object)"),
        ("o = explore_local()\ngrasp(o['cup_2'])", "unknown_object", "did you mean cup"),
        ("grasp(cop)", "unknown_name", "there is no"),
        ("x = explore_local()\nx.__class__", "unknown_name", "has no"),
        ("x = explore_local()\nx.pop('a')", "unknown_call", "has no"),
        ("for i in range(1000):\n    print(i)", "too_many_steps", "50 rounds"),
        ("for i in range(50):\n  for j in range(50):\n    print(j)", "too_many_steps", "2000 steps"),
        ("for i in range(50):\n  for j in range(3):\n    explore_local()", "too_many_steps", "100 calls"),
        ("print(1 < 'a')", "wrong_arguments", "cannot be compared"),
    ],
)
def test_errors_are_typed_and_name_what_was_meant(text: str, kind: str, words: str) -> None:
    result, _ = ran(text)
    assert result.error is not None and result.error.kind == kind and words in result.error.message


@pytest.mark.parametrize(
    "text",
    [
        "import os",
        "__import__('os').system('x')",
        "while True:\n    pass",
        "def f():\n    pass",
        "lambda: 1",
        "1 + 1",
        "'a' * 10**9",
        "[x for x in y]",
        "grasp(object=1)",
        "a, b = 1, 2",
        "x = b'1'",
        "(" * 500,
        "not " * 5000 + "1",
        "x = '" + "a" * 30_000 + "'",
        "9" * 10_000,
        "\x00",
    ],
)
def test_what_is_not_in_the_language_is_never_run(text: str) -> None:
    """Refused when it is read, or at the call that is none."""
    try:
        result, asked = ran(text)
    except PlanError as error:
        assert error.failure.kind in ("not_in_language", "syntax", "too_long") and len(error.failure.message) < 300
    else:
        assert result.error is not None and not asked


def test_time_is_bounded() -> None:
    result, asked = ran("explore_local()", late=True)
    assert result.error is not None and result.error.kind == "out_of_time" and not asked


WORDS = st.sampled_from(
    ["x", "grasp", "explore_local()", "for", "in", "if", ":", "\n", "    ", "=", "(", ")", "[0]", "."]
)


@given(st.one_of(st.text(max_size=60), st.lists(WORDS, max_size=25).map(" ".join)))
def test_any_text_ends_in_a_result_or_a_typed_error(text: str) -> None:
    try:
        result, _ = ran(text)
    except PlanError as error:
        assert error.failure.kind in ("not_in_language", "syntax", "too_long")
    else:
        assert result.error is None or result.error.kind

"""Every message that names an option or a command stands in the table, and its advice is followed."""

from __future__ import annotations

import importlib
import itertools
import os
import pkgutil
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import pytest
from scenewright.cli.main import run
from scenewright.schemas.errors import ScenewrightError

import tests.advice.table
from tests.advice.inputs import INPUTS
from tests.advice.messages import Message, messages
from tests.advice.rows import NotTried, Step, Tried

MESSAGES = messages()
MODULES = [
    importlib.import_module(f"{tests.advice.table.__name__}.{found.name}")
    for found in pkgutil.iter_modules(tests.advice.table.__path__)
]
ROWS: list[Tried | NotTried] = [row for module in MODULES for row in module.ROWS]
VALUE = re.compile(r"\{\}|%[.0-9]*[dfgs]")
"""What stands for a value in a message."""
VARIABLE = re.compile(r"[A-Z_]+=")


def meant(row: Tried | NotTried) -> list[Message]:
    """Return the messages that a row is about."""
    return [message for message in MESSAGES if message.path == row.path and row.says in message.text]


def test_every_message_that_advises_stands_in_the_table() -> None:
    told = {id(message) for row in ROWS for message in meant(row)}
    missing = [str(message) for message in MESSAGES if id(message) not in told]
    assert not missing, "\n".join(missing)


def test_every_row_is_about_a_message() -> None:
    gone = [f"{row.path}: {row.says}" for row in ROWS if not meant(row)]
    assert not gone, "\n".join(gone)


def came_up(row: Tried, output: str) -> bool:
    """Tell whether one of a row's messages is in the output, any value for each `{}`."""
    lines, whole = output.splitlines(), " ".join(output.split())
    return any(
        said(" ".join(message.text.split()), whole)
        if "\n" in message.text
        else any(said(message.text, line) for line in lines)
        for message in meant(row)
    )


def said(text: str, line: str) -> bool:
    """Tell whether the parts of a text between its values follow each other in a line."""
    at = 0
    for part in VALUE.split(text.strip()):
        at = line.find(part, at) + len(part)
        if at < len(part):
            return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize(
    "row", [pytest.param(row, id=f"{row.path} {row.says}") for row in ROWS if isinstance(row, Tried)]
)
def test_advice_that_is_followed(
    row: Tried, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    row.given(tmp_path)
    steps = "".join(step for step in (row.first, row.then) if isinstance(step, str))
    names = {name: make() for name, make in INPUTS.items() if f"{{{name}}}" in steps}

    def ends(step: Step) -> tuple[int, str]:
        code = done(step.format(**names)) if isinstance(step, str) else called(step)
        said = capfd.readouterr()
        return code, said.out + said.err

    with monkeypatch.context() as patches:
        for module in row.lacks:
            patches.setitem(sys.modules, module, None)
        code, output = ends(row.first)
    assert code == row.code and came_up(row, output), output
    code, output = ends(row.then)
    assert code == row.then_code and row.shows in output and not came_up(row, output), output
    row.right(tmp_path)


def done(line: str) -> int:
    """Run the commands of a line one after another up to the first that fails, and return the last one's exit code."""
    for command in line.split(" && "):
        words = shlex.split(command)
        variables = dict(word.split("=", 1) for word in itertools.takewhile(VARIABLE.match, words))
        with mock.patch.dict(os.environ, variables):
            code = run(words[len(variables) :])
        if code:
            return code
    return 0


def called(function: Callable[[], object]) -> int:
    """Call a function and return the exit code: its own, or that of what it raises; anything else is said."""
    try:
        result = function()
    except ScenewrightError as error:
        print(error)
        return error.exit_code
    if isinstance(result, int):
        return result
    print(result)
    return 0

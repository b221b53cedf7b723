"""Every message that names an option or a command stands in the table, and its advice is followed."""

from __future__ import annotations

import importlib
import pkgutil
import re
import shlex
from pathlib import Path

import pytest
from scenewright.cli.main import run

import tests.advice.table
from tests.advice.inputs import INPUTS
from tests.advice.messages import Message, messages
from tests.advice.rows import NotTried, Tried

MESSAGES = messages()
MODULES = [
    importlib.import_module(f"{tests.advice.table.__name__}.{found.name}")
    for found in pkgutil.iter_modules(tests.advice.table.__path__)
]
ROWS: list[Tried | NotTried] = [row for module in MODULES for row in module.ROWS]
VALUE = re.compile(r"\{\}|%[.0-9]*[dfgs]")
"""What stands for a value in a message."""


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
    patterns = (".*?".join(map(re.escape, VALUE.split(message.text.strip()))) for message in meant(row))
    return any(re.search(pattern, output, re.DOTALL) for pattern in patterns)


@pytest.mark.parametrize(
    "row", [pytest.param(row, id=f"{row.path} {row.says}") for row in ROWS if isinstance(row, Tried)]
)
def test_advice_that_is_followed(
    row: Tried, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    row.given(tmp_path)
    names = {name: make() for name, make in INPUTS.items() if f"{{{name}}}" in row.first + row.then}

    def ends(command: str) -> tuple[int, str]:
        code = run(shlex.split(command.format(**names)))
        said = capfd.readouterr()
        return code, said.out + said.err

    code, output = ends(row.first)
    assert code == row.code and came_up(row, output), output
    code, output = ends(row.then)
    assert code == row.then_code and not came_up(row, output), output
    row.right(tmp_path)

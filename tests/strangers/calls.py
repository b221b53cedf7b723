"""Runs commands in this process and reads what they say."""

from __future__ import annotations

import io
import json
import re
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from scenewright.cli import application
from scenewright.cli.main import run

CLEAR_CODES = (2, 3, 4)
"""Exit codes of a refusal: usage, bad input, an outcome that is not ok (docs/ARCHITECTURE.md, "Exit codes")."""
FOLDER_OF_A_TEST = re.compile(r"\S*/pytest-of-[^/\s]+/pytest-[^/\s]+/[^/\s]+/")


@dataclass(frozen=True)
class Said:
    """What a command did."""

    code: int
    out: str
    err: str

    @property
    def text(self) -> str:
        """Both streams, on one line, so that a wrapped word is found; without the folders of the test, which has a
        name that says what it is about."""
        return FOLDER_OF_A_TEST.sub("", " ".join((self.out + " " + self.err).split()))

    def names(self, *words: str) -> bool:
        """Return whether every word (a regular expression, small and large letters alike) is said."""
        return all(re.search(word, self.text, re.IGNORECASE) for word in words)


BUILT = cache(application.build_application)
"""The command line, built once: that takes a tenth of a second."""


def call(*arguments: str | Path) -> Said:
    """Run a command as the shell would."""
    out, err = io.StringIO(), io.StringIO()
    with patch.object(application, "build_application", BUILT), redirect_stdout(out), redirect_stderr(err):
        code = run([str(argument) for argument in arguments])
    said = Said(code, out.getvalue(), err.getvalue())
    assert code != 1 and "Traceback" not in said.text, said.text
    return said


def inspect(log: Path, *options: str | Path) -> tuple[dict[str, Any], Said]:
    """Return the report of `inspect` and what it said."""
    said = call("inspect", log, "--json", *options)
    report: dict[str, Any] = json.loads(said.out) if said.out.startswith("{") else {}
    return report, said


def advised(text: str, option: str) -> list[str]:
    """Return the values that a text gives an option: 4000 of `--depth-scale 4000`."""
    return [value.rstrip(".,;:)`'\"") for value in re.findall(rf"{re.escape(option)}[ =]([^\s)]+)", text)]


def first_option(text: str, *options: str) -> str | None:
    """Return which of these options a text names first."""
    places = {option: text.find(option) for option in options if option in text}
    return min(places, key=places.__getitem__) if places else None

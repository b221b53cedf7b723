"""A row of the table of advice: a message, what brings it up, what following it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Step = str | Callable[[], object]


def nothing(folder: Path) -> None:
    """Neither write nor ask anything."""


@dataclass(frozen=True)
class Tried:
    """Advice that is followed. Commands are run in an empty folder; `{name}` is one of tests/advice/inputs.py.

    `path` and a part of its text (`says`) name the message in the source. `first` brings it up and ends with `code`;
    `then` is `first` as the message advises and ends with `then_code`, without the message. Both are command lines as
    for a shell: `NAME=value` in front, `&&` between those that follow each other. A function does what a page or a
    notebook does, and returns an exit code or what is said.
    """

    path: str
    says: str
    first: Step
    then: Step
    code: int = 2
    then_code: int = 0
    shows: str = ""
    """What `then` says."""
    lacks: tuple[str, ...] = ()
    """Modules that cannot be imported while `first` runs."""
    given: Callable[[Path], object] = nothing
    """Writes the inputs into the folder."""
    right: Callable[[Path], object] = nothing
    """Raises AssertionError unless what `then` left in the folder is right."""


@dataclass(frozen=True)
class NotTried:
    """A message that no test can bring up or follow here, or that advises nothing, with the reason."""

    path: str
    says: str
    because: str

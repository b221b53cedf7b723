"""A row of the table of advice: a message, what brings it up, what following it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


def nothing(folder: Path) -> None:
    """Neither write nor ask anything."""


@dataclass(frozen=True)
class Tried:
    """Advice that is followed. Commands are run in an empty folder; `{name}` is one of tests/advice/inputs.py.

    `path` and a part of its text (`says`) name the message in the source. `first` brings it up and ends with `code`;
    `then` is `first` as the message advises (after what else it advises, joined by ` && `) and ends with `then_code`,
    without the message.
    """

    path: str
    says: str
    first: str
    then: str
    code: int = 2
    then_code: int = 0
    given: Callable[[Path], None] = nothing
    """Writes the inputs into the folder."""
    without: tuple[str, ...] = ()
    """Modules that cannot be imported meanwhile."""
    right: Callable[[Path], None] = nothing
    """Raises AssertionError unless what `then` left in the folder is right."""


@dataclass(frozen=True)
class NotTried:
    """A message that no test can bring up or follow here, or that advises nothing, with the reason."""

    path: str
    says: str
    because: str

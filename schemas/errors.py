"""Errors that a user can act on. Each carries the exit code of docs/ARCHITECTURE.md, and a hint of what to do next."""

from __future__ import annotations

from pydantic import ValidationError
from scenewright.schemas.plain_text import cleaned

LONGEST_PART = 200
"""Characters of a place and of a message that are said."""


class ScenewrightError(Exception):
    """Base of every expected failure: `message` says what and where, `hint` says what to do next.

    Both are cleaned: they name what came from outside.
    """

    exit_code = 1

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = cleaned(message)
        self.hint = cleaned(hint)

    def __str__(self) -> str:
        return f"{self.message} ({self.hint})" if self.hint else self.message


class UsageError(ScenewrightError):
    """An unknown option or a value out of range, on the command line or in a config file."""

    exit_code = 2


class BadInput(ScenewrightError):
    """An input file or artifact that cannot be used as it is."""

    exit_code = 3


class MissingDependency(ScenewrightError):
    """A library, weight file or device that the step needs is not there."""

    exit_code = 5


class MachineFailure(ScenewrightError):
    """Disk full, read-only file system, lock held, out of memory or time."""

    exit_code = 6


def first_problem(error: ValidationError, whole: str = "document") -> str:
    """Return `place: message` of the first wrong one of values from outside; `whole`: what they are together."""
    first = error.errors()[0]
    location = ".".join(str(part) for part in first["loc"]) or whole
    return f"{location:.{LONGEST_PART}}: {str(first['msg']).removeprefix('Value error, '):.{LONGEST_PART}}"

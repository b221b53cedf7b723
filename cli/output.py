"""What commands write: data to standard output, words for people to standard error, cleaned in both."""

from __future__ import annotations

import sys

from scenewright.schemas.plain_text import LONGEST_LINE, cleaned, one_line


def out(text: str) -> None:
    """Write lines of data to standard output."""
    sys.stdout.write(cleaned(text) + "\n")


def say(text: str) -> None:
    """Write a line for people to standard error."""
    sys.stderr.write((one_line(text) if len(text) > LONGEST_LINE else cleaned(text)) + "\n")


def say_error(text: str) -> None:
    """Write the one line of an error; nothing happens where nobody can be told."""
    try:
        sys.stderr.write("error: " + one_line(text) + "\n")
    except Exception:
        return

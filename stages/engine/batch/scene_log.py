"""The log of a scene: written by its processes, followed to know the step it is at and why it stopped."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

LOG_NAME = "batch.log"
_STEP = re.compile(rb"^\[\d+/\d+\] ([a-z][a-z0-9_]*)$")
_LONGEST_REASON = 500
"""Longest reason in a result [characters]; longer ones are cut."""
_LONGEST_LINE = 64 * 2**10
"""A line beyond this [bytes] is noise of a native library; its beginning is enough."""


def clean(text: str) -> str:
    """Return text as one line without control characters, cut to a readable length."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())
    return line if len(line) <= _LONGEST_REASON else line[: _LONGEST_REASON - 1] + "…"


class LogFollower:
    """Reads what was appended to a log since the last look."""

    def __init__(self, path: Path, steps: Sequence[str], position: int = 0) -> None:
        self.path = path
        self.position = position
        """Where the next look begins [bytes]."""
        self.step: str | None = None
        """The step that `scenewright run` announced last."""
        self.error: str | None = None
        """The last line that begins with `error:`, without that word."""
        self.last_line = ""
        self._steps = frozenset(steps)

    def look(self, final: bool = False) -> None:
        """Read on; a line without its end is left for the next look, unless this is the `final` one."""
        try:
            with self.path.open("rb") as file:
                file.seek(self.position)
                while line := file.readline(_LONGEST_LINE):
                    if not line.endswith(b"\n") and len(line) < _LONGEST_LINE and not final:
                        break
                    self.position += len(line)
                    self._take(line)
        except OSError:
            return

    def _take(self, line: bytes) -> None:
        line = line.rstrip()
        match = _STEP.match(line)
        if match is not None:
            name = match[1].decode()
            if name in self._steps:
                self.step, self.error = name, None
            return
        if line.startswith(b"error:"):
            self.error = clean(line.removeprefix(b"error:").decode(errors="replace"))
        if line:
            self.last_line = clean(line[:_LONGEST_LINE].decode(errors="replace"))

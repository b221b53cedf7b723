"""Standard output and error of this process: closed, full, or with nobody who reads, each has its exit code.

Standard output carries data, and standard error what is said to people; what came from outside is cleaned in both.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from scenewright.schemas.errors import MachineFailure, ScenewrightError
from scenewright.schemas.plain_text import cleaned

INTERRUPTED = 130
"""Exit code of an interrupted command (docs/ARCHITECTURE.md, "Exit codes")."""


class ReaderLeft(ScenewrightError):
    """Nobody reads our output any more (`| head`): an interruption."""

    exit_code = INTERRUPTED


class Stream(io.TextIOWrapper):
    """A standard stream whose failures are errors of ours, each raised once: what is written later goes nowhere.

    (The library of the command line would take a BrokenPipeError for itself, and exit with 1; and Python writes what is
    left at its end, and exits with 120 when it cannot.)
    """

    def __init__(self, descriptor: int, what: str, *, clean: bool, line_buffering: bool) -> None:
        self.what, self.clean = what, clean
        super().__init__(
            os.fdopen(descriptor, "wb"), encoding="utf-8", errors="backslashreplace", line_buffering=line_buffering
        )

    def write(self, text: str) -> int:
        """Write text. Raises ReaderLeft, MachineFailure."""
        with self._note_broken_pipe():
            super().write(cleaned(text) if self.clean else text)
        return len(text)

    def flush(self) -> None:
        """Write what is held back. Raises ReaderLeft, MachineFailure."""
        with self._note_broken_pipe():
            super().flush()

    @contextmanager
    def _note_broken_pipe(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            self._to_nowhere()
            raise ReaderLeft("the reader of the output left") from None
        except OSError as error:
            self._to_nowhere()
            raise MachineFailure(f"{self.what}: {error.strerror}", hint="send it to another place") from None

    def _to_nowhere(self) -> None:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, self.fileno())
        os.close(nothing)


def open_closed_descriptors() -> None:
    """Let the three standard descriptors be something: else the next file that is opened takes their number.

    Messages to a closed standard error are dropped; data for a closed standard output is a failure when it comes.
    """
    for descriptor, mode in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(descriptor)
        except OSError:
            opened = os.open(os.devnull, mode)
            if opened != descriptor:
                os.dup2(opened, descriptor)
                os.close(opened)


def set_up() -> None:
    """Replace the standard streams of this process.

    What native libraries print to file descriptor 1 (pybullet greets there) goes to standard error.
    """
    open_closed_descriptors()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    terminal = os.isatty(2)  # there, progress bars write controls of their own; cli/output.py cleans the rest
    sys.stdout = Stream(os.dup(1), "standard output", clean=True, line_buffering=os.isatty(1))
    sys.stderr = Stream(os.dup(2), "standard error", clean=not terminal, line_buffering=True)
    os.dup2(2, 1)

"""SIGINT and SIGTERM: raised as KeyboardInterrupt, and remembered in case somebody swallows it.

Python drops an exception that a signal handler raises inside a callback of a native library or inside a finalizer. The
runner therefore asks once more before a result takes its place.
"""

from __future__ import annotations

import signal
from types import FrameType

_requested = False


def interrupt(number: int, frame: FrameType | None) -> None:
    """Signal handler: remember that an end was asked for. Raises KeyboardInterrupt."""
    global _requested
    _requested = True
    raise KeyboardInterrupt


def install() -> None:
    """Let SIGINT and SIGTERM interrupt this process."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)


def ignore() -> None:
    """Let them pass: all is said and done."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def raise_if_requested() -> None:
    """Raise KeyboardInterrupt when a signal asked for an end, even if the first exception got lost."""
    if _requested:
        raise KeyboardInterrupt

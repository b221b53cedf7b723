"""SIGINT and SIGTERM: raised as KeyboardInterrupt, and remembered in case somebody swallows it.

An exception that a signal handler raises gets lost inside callbacks of native libraries, inside finalizers, and in
libraries that import others between `try` and `except BaseException`. While a step works it is therefore raised again
every second until it arrives, and the runner asks once more before a result takes its place. Where the interpreter
loses it (a finalizer, a callback that has nobody to raise to) it would print a traceback beside our one line: silenced.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

PARENT_VARIABLE = "SCENEWRIGHT_PARENT"
"""Environment variable: process that started this one as a step of its chain."""
SET_PARENT_DEATH_SIGNAL = 1
"""Linux: PR_SET_PDEATHSIG of prctl."""
REPEAT_SECONDS = 1.0
"""Time after which an unheeded interruption is repeated [s]."""
_requested = False
_insists = False
_waits = False


def interrupt(number: int, frame: FrameType | None) -> None:
    """Signal handler: remember that an end was asked for. Raises KeyboardInterrupt."""
    global _requested
    _requested = True
    if _waits:
        return
    if _insists:
        signal.setitimer(signal.ITIMER_REAL, REPEAT_SECONDS)
    raise KeyboardInterrupt


def install() -> None:
    """Let SIGINT and SIGTERM interrupt this process."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, interrupt)
    sys.unraisablehook = report_unraisable


def report_unraisable(lost: sys.UnraisableHookArgs) -> None:
    """Hook for exceptions that cannot be raised: as Python's, but silent once an end was asked for: the interruption is
    repeated, and finalizers of what it left half made fail."""
    if not _requested:
        sys.__unraisablehook__(lost)


@contextmanager
def waiting() -> Iterator[None]:
    """Let an interruption wait for the end of what runs inside: loading libraries, which it would crash or cripple.

    Raises KeyboardInterrupt afterwards.
    """
    global _waits
    _waits = True
    try:
        yield
    finally:
        _waits = False
    raise_if_requested()


@contextmanager
def insisting() -> Iterator[None]:
    """Raise an interruption again and again while code of others runs inside, until it arrives here."""
    global _insists
    _insists = True
    try:
        yield
    finally:
        _insists = False
        if _requested:
            signal.setitimer(signal.ITIMER_REAL, 0)


def end_with_parent() -> None:
    """Let the system interrupt this process when the chain that started it is killed (Linux).

    Else a step would go on alone, and hold its lock against the next run. Raises KeyboardInterrupt when the parent is
    gone already.
    """
    parent = os.environ.pop(PARENT_VARIABLE, "")
    if not parent.isdigit():
        return
    try:
        ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, int(signal.SIGTERM), 0, 0, 0)
    except (OSError, AttributeError):
        return
    if os.getppid() != int(parent):
        raise KeyboardInterrupt


def ignore() -> None:
    """Let them pass: all is said and done."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def heard() -> Iterator[None]:
    """Let every error that follows a signal be the interruption: libraries turn its exception into ones of their own.

    numba, for one, raises SystemError. Raises KeyboardInterrupt.
    """
    try:
        yield
    except Exception:
        raise_if_requested()
        raise


def raise_if_requested() -> None:
    """Raise KeyboardInterrupt when a signal asked for an end, even if the first exception got lost."""
    if _requested:
        raise KeyboardInterrupt

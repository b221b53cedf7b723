"""What can come of a scene. Explained outcomes say something about the scene or the machine; a crash is our bug.

A scene that ends with exit code 3 (its log cannot be used) or 4 (its plan is infeasible, its map empty) is a result,
and so is one that was stopped at a limit. Counting them as crashes would hide the crashes.
"""

from __future__ import annotations

import signal
from collections.abc import Iterable
from typing import Literal

Outcome = Literal[
    "done",
    "not ok",
    "bad input",
    "usage",
    "missing dependency",
    "machine failure",
    "time limit",
    "memory limit",
    "lost worker",
    "interrupted",
    "crash",
]

BY_EXIT_CODE: dict[int, Outcome] = {
    0: "done",
    1: "crash",
    2: "usage",
    3: "bad input",
    4: "not ok",
    5: "missing dependency",
    6: "machine failure",
    130: "interrupted",
}
"""Exit codes of a step, by what became of its scene (docs/ARCHITECTURE.md, "Exit codes")."""
MACHINE_FAILED = 6
"""Exit code of a scene that was stopped at a limit or lost with its worker."""

MEANINGS: dict[Outcome, str] = {
    "done": "every step ended well, or as `accept` in the batch file allows",
    "not ok": "a step wrote an artifact whose outcome is neither ok nor one of `accept` in the batch file",
    "bad input": "an input cannot be used as it is",
    "usage": "a value is out of range or an option unknown",
    "missing dependency": "a library, weight file or device is not there",
    "machine failure": "disk full, read-only, locked, or out of memory",
    "time limit": "stopped at [limits] time",
    "memory limit": "stopped at [limits] memory",
    "lost worker": "the machine that ran it went away, more often than retries allow",
    "interrupted": "somebody else stopped it; it will run again",
    "crash": "a bug of ours or of a native library: exit code 1 or a signal",
}


def is_explained(outcome: Outcome) -> bool:
    """Tell a failure with a reason from success and from a crash."""
    return outcome not in ("done", "crash")


def signal_of(code: int) -> int | None:
    """Return the signal that a process status stands for, or None.

    A process that died of signal n shows as -n (its parent), as 128 + n (a shell) or as 256 - n (a parent that passed
    -n on as its own exit status).
    """
    for number in (-code, code - 128, 256 - code):
        if 0 < number < signal.NSIG and (code < 0 or code > 128) and code != 130:
            return number
    return None


def signal_name(number: int) -> str:
    """Return `SIGKILL` for 9, and the number as text for a signal without a name."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def classify(code: int) -> tuple[Outcome, int]:
    """Return outcome and exit code (0 to 255) for the status of a scene's process that nobody stopped."""
    number = signal_of(code)
    if number is not None:
        return "crash", 128 + number
    return BY_EXIT_CODE.get(code, "crash"), code


def worst_exit_code(codes: Iterable[int]) -> int:
    """Return the gravest exit code: our bugs before machine failures, before inputs, before outcomes.

    A code outside the interface (a signal) is a crash like 1.
    """
    gravity = (0, 4, 2, 3, 5, 6, 130, 1)
    return max((code if code in gravity else 1 for code in codes), key=gravity.index, default=0)

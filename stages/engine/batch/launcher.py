"""Becomes another program that dies with its parent: `python -I -S launcher.py PARENT WORD...`.

The kernel sends the scene SIGTERM when the thread that started it is gone (Linux), so that a batch killed with SIGKILL
leaves no scene running unwatched. This file stands alone and imports little, as it runs before every scene.
"""

import contextlib
import ctypes
import os
import signal
import sys

SET_PARENT_DEATH_SIGNAL = 1
"""Number of `PR_SET_PDEATHSIG` in Linux's prctl."""


def main() -> None:
    """Ask for the signal, then become the command."""
    with contextlib.suppress(OSError, AttributeError):  # not Linux: the next batch ends what was left over
        ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)
    if os.getppid() != int(sys.argv[1]):
        sys.exit(128 + signal.SIGTERM)  # the parent died before the kernel knew that we care
    try:
        os.execvp(sys.argv[2], sys.argv[2:])
    except OSError as error:
        sys.stderr.write(f"error: {sys.argv[2]}: {error.strerror}\n")
        sys.exit(5)


if __name__ == "__main__":
    main()

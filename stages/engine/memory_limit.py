"""`--max-memory`: a thread looks at the resident memory of this process ten times a second and ends the step.

The main thread is interrupted by a signal of its own, so it stops at its next Python instruction: a call into a native
library is let finish, and one that never gives the interpreter free cannot be watched. What is allocated between two
looks may pass the limit. A step that has not stopped after `GRACE_SECONDS` is ended at once, with the same exit code;
its partial folder is then swept by the next run, or by `scenewright gc`.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from scenewright.schemas.errors import MachineFailure, UsageError

SECONDS_BETWEEN_LOOKS = 0.1
"""Time between two looks at the memory in use [s]."""
SECONDS_BETWEEN_SIGNALS = 5.0
"""Time between two signals to a step over the limit [s]."""
GRACE_SECONDS = 30.0
"""Time that a step over the limit gets to stop before it is ended [s]."""
HINT = "use fewer frames, larger voxels or smaller images, or raise the limit"


class _LimitReached(BaseException):
    """No Exception, so that no step takes it for one of its own."""


def parse_limit(text: str) -> int:
    """Return the limit [bytes] that `4GiB` or `500 MB` states. Raises UsageError."""
    from scenewright.stages.engine.batch.quantities import parse_bytes

    try:
        return parse_bytes(text)
    except ValueError as error:
        raise UsageError(f"--max-memory: {error}", hint="for example --max-memory 4GiB") from None


def resident_memory_bytes() -> int:
    """Return the resident memory now of this process and of those that it started [bytes], pages that they share
    counted for each; its own peak where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        for child in _children():
            with suppress(OSError, IndexError):  # it has ended
                pages += int(Path(f"/proc/{child}/statm").read_text().split()[1])
        return pages * resource.getpagesize()
    except OSError:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak if sys.platform == "darwin" else peak * 1024


def _children() -> list[str]:
    try:
        return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    except OSError:
        return []


class _Watch:
    """The thread, and what it saw."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.most = 0
        """Largest resident memory over the limit that was seen [bytes]; 0: it was never over."""
        self.armed = True
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look, name="memory limit", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; a signal that is still under way raises nothing any more. What was quicker than the first
        look is looked at now."""
        self.armed = False
        self._ended.set()
        self._thread.join()
        self._note(resident_memory_bytes())

    def _note(self, used: int) -> bool:
        """Return whether memory in use is over the limit, and remember the most."""
        over = used > self.limit
        self.most = max(self.most, used) if over else self.most
        return over

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Signal handler. Raises _LimitReached."""
        if self.armed:
            raise _LimitReached

    def message(self) -> str:
        """Say what happened."""
        used, limit = (f"{size / 2**20:.0f} MiB" for size in (self.most, self.limit))
        return f"{used} of memory in use, more than --max-memory {limit}"

    def _look(self) -> None:
        main = threading.main_thread().ident
        assert main is not None
        reached: float | None = None
        next_signal = 0.0
        while not self._ended.wait(SECONDS_BETWEEN_LOOKS):
            used, now = resident_memory_bytes(), time.monotonic()
            if self._note(used):
                reached = now if reached is None else reached
            if reached is None:
                continue
            if now >= next_signal:
                next_signal = now + SECONDS_BETWEEN_SIGNALS
                signal.pthread_kill(main, signal.SIGUSR1)
            if now > reached + GRACE_SECONDS:
                os.write(2, f"error: {self.message()}; the step did not stop, so it was ended ({HINT})\n".encode())
                os._exit(MachineFailure.exit_code)


@contextmanager
def limited(maximum: int | None, out: Path) -> Iterator[None]:
    """Stop what runs inside when resident memory passes `maximum` [bytes]; None: no limit. Main thread only.

    Raises MachineFailure naming `out`, even when the interruption itself got lost in a callback of a native library.
    """
    if maximum is None:
        yield
        return
    watch = _Watch(maximum)
    before = signal.signal(signal.SIGUSR1, watch.interrupt)
    failure: BaseException | None = None
    try:
        yield
    except _LimitReached as reached:
        failure = reached
    finally:
        watch.stop()
        signal.signal(signal.SIGUSR1, before)
    if watch.most:
        raise MachineFailure(f"{out}: {watch.message()}", hint=HINT) from failure

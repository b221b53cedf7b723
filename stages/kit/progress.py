"""Progress: a rich bar on a terminal, plain lines elsewhere, nothing in tests. Also times the named parts of a step.

Where make runs several steps at once, they have lines even on a terminal, each with the name of what is made.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")


COMPILE = "compile"
"""Part of the work that is numba's, within the parts that wait for it."""


class SilentProgress:
    """Times the parts and shows nothing."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def say(self, text: str) -> None:
        """Show a line."""

    def track(self, items: Iterable[Item], *, total: int | None = None, description: str = "") -> Iterator[Item]:
        """Yield the items."""
        yield from items

    @contextmanager
    def step(self, description: str) -> Iterator[None]:
        """Time one part of the work; parts of the same name add up."""
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[description] = self.seconds.get(description, 0.0) + time.perf_counter() - started

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Time the compilation of a function; the first one is said."""
        if COMPILE not in self.seconds:
            self.say("compile functions for this machine, kept for later runs ...")
        with SilentProgress.step(self, COMPILE):
            yield


class LineProgress(SilentProgress):
    """Plain lines on standard error, at most one every `interval` seconds, that begin with a name."""

    def __init__(self, interval: float = 5.0, name: str = "") -> None:
        super().__init__()
        self.interval, self.start = interval, f"{name}: " if name else ""

    def track(self, items: Iterable[Item], *, total: int | None = None, description: str = "") -> Iterator[Item]:
        """Yield the items and print a line now and then."""
        if total is None and hasattr(items, "__len__"):
            total = len(items)  # type: ignore[arg-type]
        started = last = time.monotonic()
        for count, item in enumerate(items, start=1):
            yield item
            now = time.monotonic()
            if now - last >= self.interval:
                last = now
                of = f"/{total}" if total else ""
                rate = count / (now - started)
                self.say(f"{description}: {count}{of} ({rate:.1f}/s)")

    @contextmanager
    def step(self, description: str) -> Iterator[None]:
        """Say what begins, and time it."""
        self.say(f"{description} ...")
        with super().step(description):
            yield

    def say(self, text: str) -> None:
        """Print a line after the name."""
        print(f"{self.start}{text}", file=sys.stderr, flush=True)


class BarProgress(SilentProgress):
    """A rich progress bar on standard error."""

    def track(self, items: Iterable[Item], *, total: int | None = None, description: str = "") -> Iterator[Item]:
        """Yield the items under a bar."""
        from rich.console import Console
        from rich.progress import track

        if total is None and hasattr(items, "__len__"):
            total = len(items)  # type: ignore[arg-type]
        yield from track(items, description=description, total=total, console=Console(stderr=True), transient=True)

    def say(self, text: str) -> None:
        """Print a line."""
        print(text, file=sys.stderr, flush=True)


_shown: list[SilentProgress] = []
"""Progress of the work that goes on, the innermost last."""


@contextmanager
def showing(progress: SilentProgress) -> Iterator[None]:
    """Show the progress of what has no context there, such as compilation."""
    _shown.append(progress)
    try:
        yield
    finally:
        _shown.remove(progress)


def shown() -> SilentProgress:
    """Return the progress of the work that goes on."""
    return _shown[-1] if _shown else SilentProgress()


def progress_for(stream_is_terminal: bool, quiet: bool = False, name: str = "") -> SilentProgress:
    """Choose how progress is shown; `name` is that of what is made."""
    if quiet:
        return SilentProgress()
    if "--jobserver" in os.environ.get("MAKEFLAGS", ""):
        return LineProgress(name=name)
    return BarProgress() if stream_is_terminal else LineProgress()

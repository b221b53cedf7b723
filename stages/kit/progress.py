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


class SilentProgress:
    """Times the parts and shows nothing."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

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
                print(f"{self.start}{description}: {count}{of} ({rate:.1f}/s)", file=sys.stderr, flush=True)

    @contextmanager
    def step(self, description: str) -> Iterator[None]:
        """Say what begins, and time it."""
        print(f"{self.start}{description} ...", file=sys.stderr, flush=True)
        with super().step(description):
            yield


class BarProgress(SilentProgress):
    """A rich progress bar on standard error."""

    def track(self, items: Iterable[Item], *, total: int | None = None, description: str = "") -> Iterator[Item]:
        """Yield the items under a bar."""
        from rich.console import Console
        from rich.progress import track

        if total is None and hasattr(items, "__len__"):
            total = len(items)  # type: ignore[arg-type]
        yield from track(items, description=description, total=total, console=Console(stderr=True), transient=True)


def progress_for(stream_is_terminal: bool, quiet: bool = False, name: str = "") -> SilentProgress:
    """Choose how progress is shown; `name` is that of what is made."""
    if quiet:
        return SilentProgress()
    if "--jobserver" in os.environ.get("MAKEFLAGS", ""):
        return LineProgress(name=name)
    return BarProgress() if stream_is_terminal else LineProgress()

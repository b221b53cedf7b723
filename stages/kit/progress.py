"""Progress: a rich bar on a terminal, plain lines elsewhere, nothing in tests. Also times the named parts of a step."""

from __future__ import annotations

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
    """Plain lines on standard error, at most one every `interval` seconds."""

    def __init__(self, interval: float = 5.0) -> None:
        super().__init__()
        self.interval = interval

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
                print(f"{description}: {count}{of} ({count / (now - started):.1f}/s)", file=sys.stderr, flush=True)

    @contextmanager
    def step(self, description: str) -> Iterator[None]:
        """Say what begins, and time it."""
        print(f"{description} ...", file=sys.stderr, flush=True)
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


def progress_for(stream_is_terminal: bool, quiet: bool = False) -> SilentProgress:
    """Choose how progress is shown."""
    if quiet:
        return SilentProgress()
    return BarProgress() if stream_is_terminal else LineProgress()

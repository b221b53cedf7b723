"""What a batch shows while it runs: a live table on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.outcomes import is_explained
from scenewright.stages.engine.batch.quantities import format_bytes, format_seconds
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scene_log import LOG_NAME, LogFollower

REFRESH = 0.5
"""Time between two drawings of the table [s]."""
LONGEST_TABLE = 30
"""Most rows of running scenes."""


class Count:
    """How far a batch is; both displays show it."""

    def __init__(self, total: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.total = total
        self.ended: Counter[str] = Counter()
        self._clock = clock
        self._begun = clock()

    def take(self, result: SceneResult) -> None:
        """Count a result."""
        explained = is_explained(result.outcome)
        self.ended["done" if result.outcome == "done" else "explained" if explained else "crashed"] += 1

    def remaining_seconds(self) -> float | None:
        """Return the time to the end [s], from the rate so far; None before the first scene has ended."""
        ended = self.ended.total()
        return (self.total - ended) * (self._clock() - self._begun) / ended if ended else None

    def as_text(self) -> str:
        """Return the count for people."""
        ended = self.ended.total()
        phrases = [f"{ended}/{self.total}"]
        phrases += [f"{self.ended[name]} {name}" for name in ("done", "explained", "crashed") if self.ended[name]]
        remaining = self.remaining_seconds()
        if remaining is not None and ended < self.total:
            phrases.append(f"{format_seconds(remaining)} to go")
        return ", ".join(phrases)


def describe(result: SceneResult) -> str:
    """Return one line about a finished scene."""
    text = f"{result.outcome}: {result.job} ({format_seconds(result.seconds)}"
    if result.peak_memory_bytes:
        text += f", {format_bytes(result.peak_memory_bytes)}"
    text += ")"
    if result.outcome != "done":
        text += f" {result.failed_step}:" if result.failed_step else ""
        text += f" {result.reason}" if result.reason else ""
    elif result.outcomes:
        text += " " + ", ".join(f"{step}: {outcome}" for step, outcome in result.outcomes.items())
    return text


class LineDisplay:
    """One line when a scene ends."""

    def __init__(self, total: int, say: Callable[[str], None]) -> None:
        self._count = Count(total)
        self._say = say

    def __enter__(self) -> LineDisplay:
        return self

    def __exit__(self, *details: Any) -> None:
        pass

    def submitted(self, job: Job) -> None:
        """Say which scene begins."""
        self._say(f"scene {job.name}")

    def finished(self, result: SceneResult) -> None:
        """Say what came of a scene."""
        self._count.take(result)
        self._say(f"[{self._count.as_text()}] {describe(result)}")

    def tick(self) -> None:
        """Nothing."""


class TableDisplay:
    """The running scenes with step and time, refreshed in place; failures scroll by above."""

    def __init__(self, total: int, console: Any) -> None:
        from rich.live import Live

        self._count = Count(total)
        self._running: dict[str, tuple[float, LogFollower]] = {}
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._console = console
        self._drawn = 0.0

    def __enter__(self) -> TableDisplay:
        self._live.__enter__()
        return self

    def __exit__(self, *details: Any) -> None:
        self._live.__exit__(*details)

    def submitted(self, job: Job) -> None:
        """Add a row."""
        log = Path(job.folder) / LOG_NAME
        position = log.stat().st_size if log.exists() else 0
        self._running[job.name] = (time.monotonic(), LogFollower(log, job.steps, position))

    def finished(self, result: SceneResult) -> None:
        """Take the row away; a scene that did not end well leaves a line."""
        from rich.text import Text

        self._running.pop(result.job, None)
        self._count.take(result)
        if result.outcome != "done":
            self._console.print(Text(describe(result), style="red" if result.outcome == "crash" else "yellow"))

    def tick(self) -> None:
        """Draw the table, now and then."""
        now = time.monotonic()
        if now - self._drawn < REFRESH:
            return
        self._drawn = now
        self._live.update(self.table(now), refresh=True)

    def table(self, now: float) -> Any:
        """Return what is drawn at `now` (time.monotonic) [s]."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        table = Table(box=None)
        for heading in ("scene", "step", "time"):
            table.add_column(heading, justify="right" if heading == "time" else "left")
        for name, (begun, follower) in list(self._running.items())[:LONGEST_TABLE]:
            follower.look()
            table.add_row(Text(name), Text(follower.step or "starting"), format_seconds(now - begun))
        hidden = len(self._running) - LONGEST_TABLE
        if hidden > 0:
            table.add_row(f"and {hidden} more", "", "")
        return Group(Text(self._count.as_text()), table)


class QuietDisplay(LineDisplay):
    """Says nothing."""

    def __init__(self) -> None:
        super().__init__(0, lambda text: None)


def display_for(total: int, say: Callable[[str], None], *, terminal: bool, quiet: bool) -> LineDisplay | TableDisplay:
    """Choose how progress is shown."""
    if quiet:
        return QuietDisplay()
    if terminal:
        from rich.console import Console

        return TableDisplay(total, Console(stderr=True))
    return LineDisplay(total, say)

"""The trials of one arm on one table, as a line of runs.jsonl."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from schemas.base import Model


class Run(Model):
    """Means over the draws of what chance decides, on one table. `case`: `<tier>/fast[/exact|/drops][/thesis15]
    [/delay<s>]`."""

    arm: str
    case: str
    seed: int
    draws: int
    time: float
    time_first: float
    """Of the first draw alone: one trial a table, as the thesis has."""
    objects_per_trip: float
    trips: float
    pulls: float
    stacks: float
    failed: float
    """Share of the draws in which something was dropped or left."""
    failed_first: bool
    planning_seconds: float = 0.0
    """CPU time of making the first plan (ours), or the dynamic programme (optimum), one thread."""


def read_runs(path: Path) -> list[Run]:
    """Return the trials of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, Run)

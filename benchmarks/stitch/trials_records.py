"""One trial of one arm, as a line of runs.jsonl."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from schemas.suture_trial import SutureRun


class Run(SutureRun):
    """A trial with the CPU time it took."""

    cpu_seconds: float


def read_runs(path: Path) -> list[Run]:
    """Return the trials of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, Run)

"""One attempt of one arm on one instance, as a line of runs.jsonl."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from schemas.base import Model


class Run(Model):
    """What an attempt came to."""

    arm: str
    case: str
    seed: int
    success: bool
    proposer_calls: int
    motion_planner_calls: int
    mesh_calls: int
    iterations: int
    seconds: float
    boxes: int
    fill: float
    failures: tuple[str, ...] = ()
    """Kind of the failure that ended each iteration, at most forty."""


def read_runs(path: Path) -> list[Run]:
    """Return the attempts of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, Run)

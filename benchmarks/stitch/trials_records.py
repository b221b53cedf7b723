"""One trial of one arm, as a line of runs.jsonl."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from schemas.base import Model
from stages.suture.trials.machine import Outcome


class Run(Model):
    """What a trial came to. Errors are of classes I, E, H, T; all but the last of a supervised trial were recovered."""

    arm: str
    seed: int
    sutures: int
    sutures_neutral: int
    attempts: int
    seconds: float
    errors: str
    reasons: list[str]
    interventions: int
    looks: int
    right: int
    abstained: int
    stopped_short: int
    thread_length: float
    cpu_seconds: float


def run_of(arm: str, seed: int, outcome: Outcome, cpu_seconds: float) -> Run:
    """Return the record of a trial."""
    return Run(
        arm=arm,
        seed=seed,
        sutures=outcome.sutures,
        sutures_neutral=outcome.sutures_neutral,
        attempts=outcome.attempts,
        seconds=round(outcome.seconds, 3),
        errors="".join(kind for kind, _ in outcome.errors),
        reasons=[reason for _, reason in outcome.errors],
        interventions=outcome.interventions,
        looks=outcome.looks,
        right=outcome.right,
        abstained=outcome.abstained,
        stopped_short=outcome.stopped_short,
        thread_length=round(outcome.thread_length, 4),
        cpu_seconds=round(cpu_seconds, 3),
    )


def read_runs(path: Path) -> list[Run]:
    """Return the trials of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, Run)

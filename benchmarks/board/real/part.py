"""The part of real logs: each against what was annotated there, and its halves against each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

from benchmarks.board.real.annotated import measure_annotated
from benchmarks.board.real.chain import masks_of
from benchmarks.board.real.figures import annotated_figures, counts, halves_figures, line
from benchmarks.board.real.halves import measure_halves
from benchmarks.board.real.logs import LOGS
from benchmarks.board.reconstruct import ARMS
from benchmarks.board.records import Line, Trial, judge_digest, key_of
from benchmarks.board.rooms import OURS, Setting

PART, ANNOTATED, HALVES = "real", "annotated", "halves"
JUDGES = ("benchmarks.board.real.annotated:measure_annotated", "benchmarks.board.real.halves:measure_halves")
"""What of this checkout decides what a log comes to."""


def names() -> tuple[str, ...]:
    """Return what is measured: `<log> annotated` and `<log> halves` of every log at hand."""
    return tuple(f"{log} {case}" for log in LOGS for case in (ANNOTATED, HALVES))


def measure_log(setting: Setting, name: str) -> Iterator[Line]:
    """Yield the line of a log in a case, kept or measured. Raises BadInput where the data folder lacks it."""
    log, case = name.split()
    trial, judge = Trial(part=PART, case=case, seed=log, arm=OURS), judge_digest(JUDGES)
    key = key_of(trial, setting.method.digest, asdict(ARMS[OURS]), judge)
    if (kept := setting.read_kept(key)) is not None:
        yield kept
        return
    scratch = setting.work / PART / setting.method.commit
    figures: dict[str, float | None]
    if case == ANNOTATED:
        annotated = measure_annotated(setting.method, log, setting.data, scratch)
        figures, said, seconds = annotated_figures([annotated]), line(annotated), annotated.seconds
        figures |= counts(annotated)
    else:
        masks = masks_of(setting.data)
        halves = measure_halves(setting.method, LOGS[log].within(setting.data), scratch, masks)
        figures, said, seconds = halves_figures([halves]), line(halves), halves.seconds
        figures |= counts(halves)
    known = {name: float(f"{value:.6g}") for name, value in figures.items() if value is not None}
    told = setting.line(trial, OURS, setting.method, figures=known, facts={"line": said}, seconds=seconds)
    yield setting.keep_line(told.model_copy(update={"key": key, "judge": judge}))

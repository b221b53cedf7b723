"""`scenewright inspect` against faults that were planted: what is detected, what is named, what is a false alarm.

Every log is opened once a fault, the fault is put into its frames in memory, and the pre-flight judges it. Logs: MCAP
files of generated rooms, and the real logs of benchmarks/board/real/logs.py. Writes reasons.json too.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import Field
from scenewright.stages.ingest import IngestParameters, InspectionReport, inspect_source, open_log
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Parameters

from benchmarks.board.real import LOGS
from benchmarks.experiment import Bench, Experiment, Results, Trial, mean, median
from benchmarks.experiments.preflight.faults import FAULTS, NOTHING, Fault, Named
from benchmarks.steps import made

REPORTED_SEEDS = tuple(str(seed) for seed in range(200, 212))
"""Rooms that no threshold was set on."""
QUICK_SEEDS = 3
RECIPES = ("room", "kitchen", "office", "bedroom")
GENERATED, REAL = "generated", "real"


class PreflightParameters(Parameters):
    """Options of the experiment."""

    rooms: Path | None = Field(
        None, description="Folder with ground_truth artifacts by seed; otherwise made in OUT/rooms"
    )
    data: Path | None = Field(None, description="Folder with the real logs")
    frames: int = Field(60, ge=2, description="Frames that are looked at")


@dataclass(frozen=True)
class Inspection:
    """What is kept of one inspection."""

    verdict: str
    detected: bool
    named: bool
    reason: str
    seconds: float


def cases_of(kind: str) -> list[str]:
    """The cases of one kind of log."""
    return [f"{kind}/{fault}" for fault in (NOTHING, *FAULTS)]


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms, or the real logs that are there."""
    if case.startswith(GENERATED):
        return REPORTED_SEEDS[: QUICK_SEEDS if bench.quick else None]
    data = bench.parameters.data
    return [name for name in LOGS if data and LOGS[name].within(data).path.exists()]


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Generate the rooms that are missing, one of the four recipes after the other."""
    folder = bench.out / "rooms"
    if bench.parameters.rooms is None and (seeds := {t.seed for t in trials if t.case.startswith(GENERATED)}):
        library = made("library build", folder / "library", "--seed", 1)
        for seed in sorted(seeds):
            recipe = ("--recipe", RECIPES[int(seed) % len(RECIPES)], "--library", library)
            size = ("--frames", 240, "--width", 320, "--height", 240)
            made("synthesize", folder / seed, *recipe, *size, "--seed", seed)


def log_of(bench: Bench, trial: Trial) -> tuple[Path, IngestParameters]:
    """Path and options of a trial's log."""
    if trial.case.startswith(GENERATED):
        rooms = bench.parameters.rooms or bench.out / "rooms"
        return rooms / trial.seed / "log.mcap", IngestParameters.model_validate({})
    log = LOGS[trial.seed].within(bench.parameters.data)
    settings = {name: float(value) for name, value in log.settings.items()}
    return log.path, IngestParameters.model_validate(settings)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Inspection]]:
    """Yield the inspection of each log with its fault."""
    for trial in trials:
        plant, named = {NOTHING: (None, None), **FAULTS}[trial.case.split("/", 1)[1]]
        report, seconds = judge(*log_of(bench, trial), plant, bench.parameters.frames)
        yield trial, inspection_of(report, seconds, named)


def judge(log: Path, parameters: IngestParameters, fault: Fault | None, frames: int) -> tuple[InspectionReport, float]:
    """Inspect a log with a fault; return the report and the CPU seconds it took."""
    source = open_log(log, parameters)
    try:
        started = time.process_time()
        planted = fault(source) if fault else source
        found = inspect_source(planted, log, parameters, frames, SilentProgress())
        return found.report, time.process_time() - started
    finally:
        source.close()


def inspection_of(report: InspectionReport, seconds: float, named: Named | None) -> Inspection:
    """What is kept of a report."""
    return Inspection(
        report.verdict,
        report.verdict != "ready",
        bool(named and named(report.cameras[0])),
        report.reason,
        round(seconds, 2),
    )


def name_of(trial: Trial) -> str:
    """The log's name in the figures of single logs."""
    return f"room {trial.seed}" if trial.case.startswith(GENERATED) else trial.seed


def more_figures(results: Results) -> dict[str, float | None]:
    """`<log>/<fault>/<measure>`: every log by itself."""
    return {
        f"{name_of(trial)}/{trial.case.split('/', 1)[1]}/{key}": float(getattr(row, key))
        for trial, row in results.records.items()
        for key in ("detected", "named", "seconds")
    }


def write_reasons(results: Results) -> None:
    """Write reasons.json."""
    rows = {str(trial): asdict(row) for trial, row in results.records.items()}
    (results.bench.out / "reasons.json").write_text(json.dumps(rows, indent=1, sort_keys=True) + "\n")


EXPERIMENT = Experiment(
    name="preflight",
    title="What `inspect` makes of planted faults",
    simulated="The faults; the rooms and their walks. The real logs are recordings.",
    knows="The log as a user gives it.",
    does_not_show="Faults that come together, or that nobody thought of.",
    arms={"ours": "ours"},
    cases=(*cases_of(GENERATED), *cases_of(REAL)),
    default_cases=lambda bench: [*cases_of(GENERATED), *(cases_of(REAL) if bench.parameters.data else [])],
    reporting=REPORTED_SEEDS,
    seeds_of=seeds_of,
    measure=measure,
    record=Inspection,
    measures={"detected": mean("detected"), "named": mean("named"), "seconds": median("seconds", "s")},
    more_figures=more_figures,
    parameters=PreflightParameters,
    places=frozenset({"rooms", "data"}),
    prepare=prepare,
    steps=("library build", "synthesize", "ingest"),
    pictures=write_reasons,
)

"""What a batch costs beside its scenes: overhead per scene, efficiency on two cores, the scheduler as batches grow.

Overhead: the same scenes one after the other by `scenewright run`, and as a batch with one job; the one step of the
pipeline is up to date, so that nearly all of it is starting processes. The same with a program that does nothing.
Efficiency: scenes that multiply matrices, on one core, and on two as the batch shares out their threads. Occupied is
the share of slots x time in which a scene ran: what the batch itself leaves idle, whatever else the machine does.
On a machine that others use, one job on one core is given more than half of what two jobs on two are given, so that
the plain ratio falls short of 2 whatever the batch does; beside it stands the ratio had the machine been ours: 2 x
occupied x processor time of the scenes on one core over that on two.
Scheduler: scenes that end at once, through everything but the processes.
Cases alternate within a run, as the machine may be busy with other work; medians over the runs are given.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from pydantic import Field
from scenewright.schemas.places import HOME
from scenewright.stages.engine.batch.expansion import Batch, PlannedRun, make_jobs, read_batch, scene_command
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.local_executor import LocalExecutor
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scheduler import run_jobs
from scenewright.stages.engine.batch.session import BatchEnd, run_batch
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Trial, median
from benchmarks.timing import alone

RUNNING, NOTHING, EFFICIENCY = "scenewright run", "a program that does nothing", "two cores"
SIMULATED = {f"{count} scenes that end at once": count for count in (100, 1_000, 10_000)}
UNITS = {
    **dict.fromkeys(("in a batch over alone", "in a batch over alone, processor time"), ""),
    **dict.fromkeys(("alone", "in a batch", "in a batch of two jobs", "processor"), "ms"),
    **dict.fromkeys(("scheduler's loop", "reading the batch file", "wall", "again"), "ms"),
    "memory": "MB",
    **dict.fromkeys(("one job over one core", "two jobs over one core"), ""),
    **dict.fromkeys(("two jobs, threads not shared out over one core", "slots occupied, two jobs"), ""),
    "two jobs over one core, had the machine been ours": "",
}


class BatchParameters(Parameters):
    """Options of the experiment."""

    scenes: int = Field(6, ge=2, description="Scenes of a batch that runs programs")
    rounds: int = Field(80, ge=1, description="Products of matrices in a scene")


PIPELINE = """
name = "tiny"
summary = "one step"
[variables.log]
description = "a log"
[[step]]
name = "sequence"
stage = "ingest"
inputs = { log = "$log" }
"""
WORK = """
import sys
import numpy
a = numpy.random.default_rng(0).standard_normal((600, 600))
for _ in range(int(sys.argv[1])):
    a = a @ a
    a /= abs(a).max()
"""


def write_logs(folder: Path, count: int) -> Batch:
    """Write `count` small logs in the layout of 7-Scenes and a batch over them."""
    rows = np.mgrid[0:60, 0:80][0]
    for number in range(count):
        log = folder / "logs" / f"room-{number}"
        log.mkdir(parents=True)
        np.savetxt(log / "camera-intrinsics.txt", [[70.0, 0.0, 39.5], [0.0, 70.0, 29.5], [0.0, 0.0, 1.0]])
        for frame in range(2):
            name = f"frame-{frame:06d}"
            np.savetxt(log / f"{name}.pose.txt", np.eye(4))
            cv2.imwrite(str(log / f"{name}.depth.png"), (1500 + 5 * rows).astype(np.uint16))
            cv2.imwrite(str(log / f"{name}.color.jpg"), np.dstack([rows, rows, rows]).astype(np.uint8))
    return write_batch(folder)


def write_batch(folder: Path) -> Batch:
    """Write pipeline and batch file over the logs that are there."""
    (folder / "tiny.toml").write_text(PIPELINE)
    spec = folder / "batch.toml"
    spec.write_text('pipeline = "tiny.toml"\n[data]\nvariable = "log"\nglob = "logs/*"\n')
    return read_batch(spec)


def timed_batch(batch: Batch, out: Path, **options: object) -> tuple[float, BatchEnd]:
    """Run a batch anew; returns its wall clock [s] too. Every scene has to end well."""
    started = time.perf_counter()
    end = run_batch(batch, out, retry="all", **options)  # type: ignore[arg-type]
    seconds = time.perf_counter() - started
    if end.counts() != {"done": len(batch.runs)}:
        raise RuntimeError(f"scenes failed: {end.counts()}; see {out}/summary.md")
    return seconds, end


def processor_seconds() -> float:
    """Return the processor time of this process and of the children it has waited for [s]."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def occupied(end: BatchEnd, jobs: int, seconds: float) -> float:
    """Return the share of slots x time in which a scene ran."""
    return sum(result.seconds for result in end.ran) / (jobs * seconds)


def measure_overhead(folder: Path, scenes: int) -> dict[str, float]:
    """Return milliseconds per scene of `scenewright run` alone and in a batch."""
    batch, out = write_logs(folder, scenes), folder / "out"
    run_batch(batch, out, jobs=2)
    environment = {**os.environ, "PYTHONPATH": str(HOME)}
    started, processor = time.perf_counter(), processor_seconds()
    for run in batch.runs:
        command = scene_command(batch, run, out / run.name, force=False)
        subprocess.run(command, check=True, capture_output=True, env=environment)
    direct, direct_processor = (time.perf_counter() - started) / scenes, processor_seconds() - processor
    processor = processor_seconds()
    seconds, _ = timed_batch(batch, out, jobs=1)
    return {
        "alone": 1000 * direct,
        "in a batch": 1000 * seconds / scenes,
        "in a batch over alone": seconds / scenes / direct,
        "in a batch over alone, processor time": (processor_seconds() - processor) / direct_processor,
    }


def measure_nothing(folder: Path, scenes: int) -> dict[str, float]:
    """Return milliseconds per scene of a program that does nothing, alone and in a batch."""
    for number in range(scenes):
        (folder / "logs" / f"room-{number}").mkdir(parents=True)
    batch = write_batch(folder)

    def nothing(batch: Batch, run: PlannedRun, folder: Path, *, force: bool) -> tuple[str, ...]:
        return ("true",)

    started = time.perf_counter()
    for _ in range(scenes):
        subprocess.run(["true"], check=True)
    direct = (time.perf_counter() - started) / scenes
    processor = processor_seconds()
    one, _ = timed_batch(batch, folder / "one", jobs=1, command=nothing)
    processor = processor_seconds() - processor
    two, _ = timed_batch(batch, folder / "two", jobs=2, command=nothing)
    return {
        "alone": 1000 * direct,
        "in a batch": 1000 * one / scenes,
        "in a batch of two jobs": 1000 * two / scenes,
        "processor": 1000 * processor / scenes,
    }


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Let this process and what it starts use `count` of its processors only."""
    everything = os.sched_getaffinity(0)
    os.sched_setaffinity(0, set(sorted(everything)[:count]))
    try:
        yield
    finally:
        os.sched_setaffinity(0, everything)


def measure_efficiency(folder: Path, scenes: int, rounds: int) -> dict[str, float]:
    """Return the rate of two cores over one, with the threads of scenes shared out and without."""
    for number in range(scenes):
        (folder / "logs" / f"room-{number}").mkdir(parents=True)
    batch = write_batch(folder)

    def multiply(batch: Batch, run: PlannedRun, folder: Path, *, force: bool) -> tuple[str, ...]:
        return (sys.executable, "-c", WORK, str(rounds))

    arms = {
        "one core": (1, 1, None),
        "one job": (2, 1, None),
        "two jobs": (2, 2, None),
        "two jobs, threads not shared out": (2, 2, 2),
    }
    seconds, busy, used = {}, {}, {}
    for arm, (cores, jobs, threads) in arms.items():
        with on_cores(cores):
            executor, processor = LocalExecutor(jobs, threads), processor_seconds()
            seconds[arm], end = timed_batch(batch, folder / arm, executor=executor, command=multiply)
        busy[arm], used[arm] = occupied(end, jobs, seconds[arm]), processor_seconds() - processor
    undisturbed = 2 * used["one core"] / used["two jobs"] * busy["two jobs"] / busy["one core"]
    return {
        **{f"{arm} over one core": seconds["one core"] / seconds[arm] for arm in arms if arm != "one core"},
        "two jobs over one core, had the machine been ours": undisturbed,
        "slots occupied, two jobs": busy["two jobs"],
    }


class InstantExecutor:
    """Ends every job at once."""

    def __init__(self) -> None:
        self._held: list[Job] = []

    def capacity(self) -> int:
        """Return the slots of a small cluster."""
        return 64

    def submit(self, job: Job) -> None:
        """Hold the job."""
        self._held.append(job)

    def completed(self, timeout: float) -> list[SceneResult]:
        """End one job."""
        job = self._held.pop(0)
        measures = {f"evaluation/measure-{k}": k + len(job.name) / 7 for k in range(20)}
        return [
            SceneResult(
                job=job.name,
                scene=job.scene,
                fingerprint=job.fingerprint,
                outcome="done",
                exit_code=0,
                seconds=1.0,
                started="2026-01-01T00:00:00",
                measures=measures,
                peak_memory_bytes=0,
                attempts=1,
            )
        ]

    def cancel(self) -> None:
        """Nothing runs."""

    def close(self) -> None:
        """Nothing is held."""


def measure_scheduler(folder: Path, scenes: int) -> dict[str, float]:
    """Return milliseconds per scene of the scheduler alone, and of a whole batch with files and summary."""
    for number in range(scenes):
        (folder / "logs" / f"room-{number}").mkdir(parents=True)
    batch = write_batch(folder)
    jobs = make_jobs(batch, folder / "out")
    started = time.perf_counter()
    run_jobs(jobs, InstantExecutor(), lambda result: None)
    loop = time.perf_counter() - started
    started = time.perf_counter()
    read_batch(batch.path)
    reading = time.perf_counter() - started
    processor = processor_seconds()
    whole, _ = timed_batch(batch, folder / "out", executor=InstantExecutor())
    processor = processor_seconds() - processor
    started = time.perf_counter()
    again = run_batch(batch, folder / "out")
    resumed = time.perf_counter() - started
    if again.ran:
        raise RuntimeError("a finished batch ran again")
    return {
        "scheduler's loop": 1000 * loop / scenes,
        "reading the batch file": 1000 * reading / scenes,
        "wall": 1000 * whole / scenes,
        "processor": 1000 * processor / scenes,
        "again": 1000 * resumed / scenes,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Yield what each case took in each run."""
    scenes = bench.parameters.scenes
    for trial in trials:
        folder = Path(tempfile.mkdtemp())
        try:
            if trial.case == RUNNING:
                yield trial, measure_overhead(folder, scenes)
            elif trial.case == NOTHING:
                yield trial, measure_nothing(folder, 10 * scenes)
            elif trial.case == EFFICIENCY:
                yield trial, measure_efficiency(folder, scenes, bench.parameters.rounds)
            else:
                yield trial, alone(measure_scheduler, folder, SIMULATED[trial.case])
        finally:
            shutil.rmtree(folder)


EXPERIMENT = Experiment(
    name="batch_cost",
    title="What a batch costs",
    simulated="Nothing; of the last cases the scenes, which end at once, with twenty measures each.",
    knows="Nothing.",
    does_not_show="What scenes cost. Speed-up where others use the machine: one job on one core is then given more "
    "than half of what two jobs on two are given. Ratios say more than times.",
    arms={"ours": "ours"},
    cases=(RUNNING, NOTHING, EFFICIENCY, *SIMULATED),
    default_cases=lambda bench: [RUNNING, NOTHING, EFFICIENCY, *list(SIMULATED)[: 1 if bench.quick else None]],
    reporting=tuple(f"run {k}" for k in range(1, 6)),
    quick_seeds=1,
    together=lambda trial: trial.seed,
    measure=measure,
    record=dict[str, float],
    measures={name: median(name, unit) for name, unit in UNITS.items()},
    parameters=BatchParameters,
    quick={"scenes": 4, "rounds": 30},
)

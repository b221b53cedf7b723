"""What a batch costs beside its scenes: overhead per scene, efficiency on two cores, the scheduler at 1,000 scenes.

    python -m benchmarks.speed.batch [--out FOLDER] [--quick]

Overhead: the same scenes one after the other by `scenewright run`, and as a batch with one job; the one step of the
pipeline is up to date, so that nearly all of it is starting processes. The same with a program that does nothing.
Efficiency: scenes that multiply matrices, on one core, and on two as the batch shares out their threads. Occupied is
the share of slots x time in which a scene ran: what the batch itself leaves idle, whatever else the machine does.
On a machine that others use, one job on one core is given more than half of what two jobs on two are given, so that
the plain ratio falls short of 2 whatever the batch does; beside it stands the ratio had the machine been ours: 2 x
occupied x processor time of the scenes on one core over that on two.
Scheduler: 1,000 scenes that end at once, through everything but the processes.
Arms alternate within a run, as the machine may be busy with other work; medians over the runs are given.
"""

from __future__ import annotations

import os
import platform
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.places import HOME
from scenewright.stages.engine.batch.expansion import Batch, PlannedRun, make_jobs, read_batch, scene_command
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.local_executor import LocalExecutor, processors
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scheduler import run_jobs
from scenewright.stages.engine.batch.session import BatchEnd, run_batch
from scenewright.stages.kit.measurement.tables import Table, as_markdown

from benchmarks.options import Measurement, asked
from benchmarks.results import write_measured

AIM_EFFICIENCY = 1.8
"""Scenes per second on two cores over those on one."""
AIM_SCHEDULER_MS = 10.0
"""The scheduler's time for a scene."""
PARTS = ("overhead", "nothing", "efficiency", "scheduler")
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
    """Return seconds per scene of `scenewright run` alone and in a batch."""
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
        "run/alone_s": direct,
        "run/batch_s": seconds / scenes,
        "run/ratio": seconds / scenes / direct,
        "run/processor_ratio": (processor_seconds() - processor) / direct_processor,
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
        "nothing/alone_ms": 1000 * direct,
        "nothing/batch_ms": 1000 * one / scenes,
        "nothing/batch_two_jobs_ms": 1000 * two / scenes,
        "nothing/batch_processor_ms": 1000 * processor / scenes,
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

    arms = {"one_core": (1, 1, None), "one_job": (2, 1, None), "two_jobs": (2, 2, None), "two_jobs_free": (2, 2, 2)}
    figures = {}
    for arm, (cores, jobs, threads) in arms.items():
        with on_cores(cores):
            executor, processor = LocalExecutor(jobs, threads), processor_seconds()
            seconds, end = timed_batch(batch, folder / arm, executor=executor, command=multiply)
        figures[f"efficiency/{arm}_s"] = seconds
        figures[f"efficiency/{arm}_occupied"] = occupied(end, jobs, seconds)
        figures[f"efficiency/{arm}_processor_s"] = processor_seconds() - processor
    cost = figures["efficiency/one_core_processor_s"] / figures["efficiency/two_jobs_processor_s"]
    figures["efficiency/two_jobs_undisturbed"] = (
        2 * cost * (figures["efficiency/two_jobs_occupied"] / figures["efficiency/one_core_occupied"])
    )
    for arm in ("one_job", "two_jobs", "two_jobs_free"):
        figures[f"efficiency/{arm}_over_one_core"] = figures["efficiency/one_core_s"] / figures[f"efficiency/{arm}_s"]
    return figures


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
        "scheduler/loop_ms": 1000 * loop / scenes,
        "scheduler/reading_ms": 1000 * reading / scenes,
        "scheduler/whole_ms": 1000 * whole / scenes,
        "scheduler/processor_ms": 1000 * processor / scenes,
        "scheduler/nothing_to_do_ms": 1000 * resumed / scenes,
    }


def measure(runs: int, scenes: int, rounds: int, many: int) -> dict[str, float]:
    """Return the medians over the runs, with the least and the most of each ratio."""
    collected: dict[str, list[float]] = {}
    for number in range(runs):
        for part in PARTS:
            print(f"run {number + 1}/{runs}: {part}", file=sys.stderr, flush=True)
            folder = Path(tempfile.mkdtemp())
            try:
                figures = {
                    "overhead": lambda folder=folder: measure_overhead(folder, scenes),
                    "nothing": lambda folder=folder: measure_nothing(folder, 10 * scenes),
                    "efficiency": lambda folder=folder: measure_efficiency(folder, scenes, rounds),
                    "scheduler": lambda folder=folder: measure_scheduler(folder, many),
                }[part]()
            finally:
                shutil.rmtree(folder)
            for name, value in figures.items():
                collected.setdefault(name, []).append(value)
    metrics = {name: statistics.median(values) for name, values in collected.items()}
    for name, values in collected.items():
        metrics |= {f"{name}_least": min(values), f"{name}_most": max(values)}
    sizes = {"all/runs": runs, "all/scenes": scenes, "all/many": many, "all/load": os.getloadavg()[0]}
    return metrics | {name: float(value) for name, value in sizes.items()}


ROWS = (
    ("scenewright run, alone", "run/alone_s", "s a scene"),
    ("scenewright run, in a batch of one job", "run/batch_s", "s a scene"),
    ("in a batch over alone", "run/ratio", ""),
    ("the same, processor time", "run/processor_ratio", ""),
    ("a program that does nothing, alone", "nothing/alone_ms", "ms a scene"),
    ("the same in a batch of one job", "nothing/batch_ms", "ms a scene"),
    ("the same, processor time", "nothing/batch_processor_ms", "ms a scene"),
    ("the same in a batch of two jobs", "nothing/batch_two_jobs_ms", "ms a scene"),
    ("rate on two cores, two jobs, over one core", "efficiency/two_jobs_over_one_core", ""),
    ("rate on two cores, one job, over one core", "efficiency/one_job_over_one_core", ""),
    (
        "rate on two cores, two jobs, threads not shared out, over one core",
        "efficiency/two_jobs_free_over_one_core",
        "",
    ),
    ("the same, two jobs, had the machine been ours (below)", "efficiency/two_jobs_undisturbed", ""),
    ("slots occupied, two jobs", "efficiency/two_jobs_occupied", ""),
    ("scheduler alone", "scheduler/loop_ms", "ms a scene"),
    ("reading and checking the batch file", "scheduler/reading_ms", "ms a scene"),
    ("whole batch without processes: plan, results, summary", "scheduler/whole_ms", "ms a scene"),
    ("the same, processor time", "scheduler/processor_ms", "ms a scene"),
    ("a second batch that finds all done", "scheduler/nothing_to_do_ms", "ms a scene"),
)


def as_table(metrics: dict[str, float]) -> Table:
    """Return the figures as a table: median, least and most of the runs."""
    rows = tuple(
        (text, metrics[name], metrics[f"{name}_least"], metrics[f"{name}_most"], unit) for text, name, unit in ROWS
    )
    efficiency, whole = metrics["efficiency/two_jobs_over_one_core"], metrics["scheduler/whole_ms"]
    note = (
        f"{metrics['all/runs']:.0f} runs, {metrics['all/scenes']:.0f} scenes ({metrics['all/many']:.0f} for the "
        f"scheduler), {processors()} processors, {platform.machine()}, Python {platform.python_version()}, load "
        f"average {metrics['all/load']:.1f} at the end. Aims: rate on two cores at least {AIM_EFFICIENCY} of one "
        f"({efficiency:.2f}: {'met' if efficiency >= AIM_EFFICIENCY else 'missed'}), scheduler under "
        f"{AIM_SCHEDULER_MS:g} ms a scene ({whole:.2f}: {'met' if whole < AIM_SCHEDULER_MS else 'missed'})."
    )
    return Table("table", "What a batch costs", ("", "median", "least", "most", "unit"), rows, note)


def main() -> None:
    """Measure, print the table, write metrics.json and table.md."""
    arguments = asked(Measurement)
    metrics = measure(1, 4, 30, 200) if arguments.quick else measure(5, 6, 80, 1000)
    text = as_markdown(as_table(metrics))
    write_measured(arguments.out, metrics, text)


if __name__ == "__main__":
    main()

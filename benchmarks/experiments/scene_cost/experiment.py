"""What a short scene costs in a batch: stretches of three logs, a process a step, and in warm workers.

Each stretch (two logs are recorded, one is rendered) goes to the graph of its room by the pipeline `short_logs.toml`.
Every scene has to end well, with the same digests both ways. A run that was stopped goes on.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.batch.expansion import Batch, read_batch
from scenewright.stages.engine.batch.local_executor import LocalExecutor
from scenewright.stages.engine.batch.results import RESULTS_NAME, SceneResult, latest_by_job, read_results
from scenewright.stages.engine.batch.session import run_batch
from scenewright.stages.engine.reading import read_manifest
from scenewright.stages.engine.runner import PROCESSOR
from scenewright.stages.engine.store import TIMINGS_NAME
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, mean
from benchmarks.tabulation import Figure

LOGS = {
    "kitchen": ("7scenes_redkitchen", 500),
    "livingroom": ("redwood_livingroom1", 211),
    "office": ("hololens_office", 187),
}
"""Folder and frames of each log; every second scene is of the kitchen."""
SPAN, EVERY = 12, 2
"""Frames of a log that a scene spans, and the step between those that it uses: six frames."""
ARMS = {"cold": "a process a step", "warm": "warm workers"}
PIPELINE = Path(__file__).with_name("short_logs.toml")


STEPS = {"ingest": "sequence", "segment": "segments", "fuse": "panoptic_map", "graph": "contact_graph"}
"""Step of the pipeline -> its artifact."""
BESIDE = "beside the steps"


class SceneParameters(Parameters):
    """Options of the experiment."""

    logs: Path = Field(Path("../shared/data"), description="Folder of the recorded logs")
    scenes: int = Field(10, ge=1, description="Stretches of logs")


def stretches(scenes: int) -> list[tuple[str, str, int]]:
    """Return name, log folder and first frame of every scene: spread evenly over each log, no two alike."""
    names = ["kitchen" if k % 2 == 0 else ("livingroom", "office")[k // 2 % 2] for k in range(scenes)]
    found = []
    for log, (folder, frames) in LOGS.items():
        count = names.count(log)
        if count > frames - SPAN:
            raise UsageError(f"{scenes} scenes: {folder} has not as many different stretches", hint="ask for fewer")
        starts = [k * (frames - SPAN) // max(1, count - 1) for k in range(count)]
        found += [(f"{log}-{start:03d}", folder, start) for start in starts]
    return found


def batch_file(folder: Path, logs: Path, scenes: list[tuple[str, str, int]]) -> Batch:
    """Write and read a batch file of the scenes."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f'pipeline = "{PIPELINE}"', f'[set]\nevery = "{EVERY}"']
    for name, log, start in scenes:
        values = f'log = "{(logs / log).resolve()}", start = {start}, stop = {start + SPAN}'
        lines.append(f'[[scene]]\nname = "{name}"\nset = {{ {values} }}')
    (folder / "batch.toml").write_text("\n".join(lines))
    return read_batch(folder / "batch.toml")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Run the scenes both ways, compare, and yield what each cost."""
    scenes, found = stretches(bench.parameters.scenes), {}
    for arm in ARMS:
        folder = bench.out / "runs" / arm
        batch = batch_file(folder, bench.parameters.logs, scenes)
        run_batch(batch, folder / "out", executor=LocalExecutor(1, 1, warm=arm == "warm"), say=_say)
        found[arm] = _all_done(batch, folder)
    for name, result in found["cold"].items():
        if result.artifacts != found["warm"][name].artifacts:
            raise RuntimeError(f"{name}: other digests in a warm worker")
    for trial in trials:
        yield trial, _cost(bench.out / "runs" / trial.arm / "out", found[trial.arm][trial.seed])


def _all_done(batch: Batch, folder: Path) -> dict[str, SceneResult]:
    found = latest_by_job(read_results(folder / "out" / RESULTS_NAME))
    missing = [run.name for run in batch.runs if run.name not in found or found[run.name].outcome != "done"]
    if missing:
        raise RuntimeError(f"{len(missing)} scenes did not end well, {missing[0]} for one; see {folder}/out/summary.md")
    return {run.name: found[run.name] for run in batch.runs}


def _cost(out: Path, result: SceneResult) -> dict[str, float]:
    """Return processor time, bytes and memory of a scene, and those of every step and beside the steps."""
    costs = {
        "all/core-seconds": result.processor_seconds,
        "all/megabytes": result.artifact_bytes / 1e6,
        "all/memory": result.peak_memory_bytes / 1e6,
        f"{BESIDE}/core-seconds": result.processor_seconds,
    }
    for step, name in STEPS.items():
        artifact = out / result.scene / name
        seconds = json.loads((artifact / TIMINGS_NAME).read_text())[PROCESSOR]
        costs[f"{step}/megabytes"] = sum(file.bytes for file in read_manifest(artifact).files) / 1e6
        costs[f"{step}/core-seconds"] = seconds
        costs[f"{BESIDE}/core-seconds"] -= seconds
    return costs


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def part_of(step: str) -> Callable[[Mapping[str, float]], dict[str, float]]:
    """Return what picks the costs of a step out of those of a scene."""
    return lambda record: {k.removeprefix(f"{step}/"): v for k, v in record.items() if k.startswith(f"{step}/")}


def most_memory(records: Sequence[Mapping[str, float]]) -> float | None:
    """Return the largest memory of any scene [MB]."""
    return max((record["memory"] for record in records if "memory" in record), default=None)


def hundred_thousand(results: Results) -> Mapping[str, Figure]:
    """Return core-hours and terabytes of a hundred thousand scenes."""
    figures = {}
    for arm in results.arms("all"):
        seconds, size = (results.value(arm, "all", name) or 0.0 for name in ("core-seconds", "megabytes"))
        count = len(results.of(arm, "all"))
        figures[f"{arm}/all/hundred thousand"] = Figure(1e5 * seconds / 3600, None, None, count, "core-hours")
        figures[f"{arm}/all/hundred thousand on disk"] = Figure(1e5 * size / 1e6, None, None, count, "TB")
    return figures


EXPERIMENT = Experiment(
    name="scene_cost",
    title="What a short scene costs",
    simulated="The living room's pictures are rendered; the kitchen and the office are recorded.",
    knows="Exact poses of the logs.",
    does_not_show="Scenes of a user's size: six frames each, to the graph of the room by geometry alone. A cluster. "
    "The loading of libraries once a worker is not in it.",
    arms=ARMS,
    cases=("scene",),
    seeds_of=lambda bench, case: [name for name, _, _ in stretches(bench.parameters.scenes)],
    together=lambda trial: "",
    measure=measure,
    record=dict[str, float],
    measures={
        "core-seconds": mean("core-seconds", "s", interval=False),
        "megabytes": mean("megabytes", "MB", interval=False),
        "memory": Measure(most_memory, "MB", interval=False),
    },
    parameters=SceneParameters,
    places=frozenset({"logs"}),
    quick={"scenes": 3},
    steps=tuple(STEPS),
    subcases={step: ("scene", part_of(step)) for step in (*STEPS, BESIDE, "all")},
    more_figures=hundred_thousand,
)

"""From a log to an interactive scene: seconds by step, frames a second, memory; this code and one of before in turn.

Runs `scenewright run reconstruct` on every frame of a recorded log for three backends, with the CAD library made before
(runs share it), by this code and by the checkout of earlier code in `--before`, one after the other for each backend.
Nothing else should run beside it. Artifacts of both codes are compared by their content digests.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.places import HOME
from scenewright.stages.engine.batch.processes import descendants, resident_memory
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Trial, only

BACKENDS = ("auto", "detector", "geometric")
STEPS = (
    "sequence",
    "segments",
    "articulations",
    "panoptic_map",
    "contact_graph",
    "cad_library",
    "cad_scene",
    "interactive_scene",
    "evaluation",
    "report",
)
FIRST_FRAMES = 8
"""Of a run before each that is measured, in which numba compiles what has changed."""
SECONDS_BETWEEN_LOOKS = 0.2
PEAKS = ("peak memory", "peak memory, shared pages for each")
UNITS = {
    "frames": "",
    "frames per s": "",
    "same artifacts": "",
    **dict.fromkeys(PEAKS, "MB"),
    **dict.fromkeys(("whole", "processor time", *STEPS), "s"),
}


class ReconstructParameters(Parameters):
    """Options of the experiment."""

    log: Path = Field(Path("../shared/data/7scenes_redkitchen"), description="A posed RGB-D log")
    weights: Path = Field(Path("../shared/data/detectors/yolox_nano.onnx"), description="Detector's weights")
    before: Path | None = Field(None, description="Checkout of earlier code with its own .venv, to measure in turn")
    frames: int | None = Field(None, ge=1, description="Use at most so many frames")


@dataclass
class Run:
    """What a run took."""

    seconds: float
    processor_seconds: float
    """Of all its processes."""
    peak_memory: int
    """Most memory of all its processes together, shared pages counted once [bytes]."""
    peak_resident: int
    """... and counted for each that shares them."""
    steps: dict[str, dict[str, Any]]
    """Step -> what it said (`--json`) and `seconds` of its process."""


def run_once(code: Path, folder: Path, settings: dict[str, str]) -> Run:
    """Run the pipeline by the code of a checkout. Raises RuntimeError when it fails."""
    python = code / ".venv" / "bin" / "python"
    words = [str(python), "-m", "scenewright", "run", "reconstruct", "--out", str(folder), "--json"]
    shutil.rmtree(folder, ignore_errors=True)  # not --force, which would make the library again
    words += [word for name, value in settings.items() for word in ("--set", f"{name}={value}")]
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    began, used = time.perf_counter(), _processor_seconds()
    process = subprocess.Popen(
        words,
        cwd=code,
        env={**environment, "PYTHONPATH": str(code)},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    peak, starts = [0, 0], []

    def watch() -> None:
        while process.poll() is None:
            peak[0] = max(peak[0], _proportional_memory(process.pid))
            peak[1] = max(peak[1], resident_memory(process.pid))
            time.sleep(SECONDS_BETWEEN_LOOKS)

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()
    assert process.stderr is not None and process.stdout is not None
    said = []
    for line in process.stderr:
        said.append(line)
        if line.startswith("[") and "/" in line.split("]")[0]:
            starts.append((line.split()[1], time.perf_counter()))
    output = process.stdout.read()
    process.wait()
    ended = time.perf_counter()
    watching.join()
    if not output.strip():
        raise RuntimeError(f"{code}: exit {process.returncode}: {''.join(said[-3:])}")
    steps = {Path(facts["path"]).name: facts for facts in json.loads(output)["steps"]}
    ends = [start for _, start in starts[1:]] + [ended]
    for (name, start), end in zip(starts, ends, strict=True):
        if name in steps:
            steps[name]["seconds"] = end - start
    return Run(ended - began, _processor_seconds() - used, peak[0], peak[1], steps)


def _proportional_memory(pid: int) -> int:
    """Return the memory of a process and all below it [bytes], pages that they share counted once (Linux)."""
    total = 0
    for number in (pid, *descendants(pid)):
        with suppress(psutil.Error):
            total += psutil.Process(number).memory_full_info().pss
    return total


def _processor_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Yield what each code took with a backend."""
    given, out = bench.parameters, bench.out.resolve()
    settings = {"log": str(given.log.resolve()), "backend": trials[0].case, "every": "1"}
    if trials[0].case == "detector":
        settings["weights"] = str(given.weights.resolve())
    if given.frames is not None:
        settings["max_frames"] = str(given.frames)
    before: Run | None = None
    for trial in trials:
        code = _code_of(given, trial.arm)
        _make_library(code, out / trial.arm)
        run_once(code, out / trial.arm / "compiling", {**settings, "max_frames": str(FIRST_FRAMES)})
        run = run_once(code, out / trial.arm / trial.case, settings)
        used = run.steps["sequence"]["summary"]["frames"]
        values = {
            "frames": used,
            "whole": run.seconds,
            "frames per s": used / run.seconds,
            "processor time": run.processor_seconds,
            PEAKS[0]: run.peak_memory / 1e6,
            PEAKS[1]: run.peak_resident / 1e6,
            **{step: facts["seconds"] for step, facts in run.steps.items()},
        }
        if before is not None:
            pairs = ((facts, before.steps.get(step, {})) for step, facts in run.steps.items())
            values["same artifacts"] = sum(ours["content_digest"] == old.get("content_digest") for ours, old in pairs)
        before = run
        yield trial, values


def _code_of(given: ReconstructParameters, arm: str) -> Path:
    """Return the checkout of an arm. Raises UsageError where there is none."""
    code = HOME if arm == "ours" or given.before is None else given.before.resolve()
    if not (code / ".venv" / "bin" / "python").exists():
        raise UsageError(f"{code}: no checkout with a .venv", hint="git worktree add, link .venv")
    return code


def _make_library(code: Path, folder: Path) -> None:
    """Make the CAD library once, where the runs of a code share it."""
    python = code / ".venv" / "bin" / "python"
    words = [str(python), "-m", "scenewright", "library", "build", "--seed", "1", "--shared", str(folder / ".shared")]
    subprocess.run(
        [*words, "--out", str(folder / "library"), "--quiet"],
        cwd=code,
        env={**os.environ, "PYTHONPATH": str(code)},
        check=True,
        stdout=subprocess.DEVNULL,
    )


EXPERIMENT = Experiment(
    name="speed_reconstruct",
    title="From a log to an interactive scene",
    simulated="Nothing: the kitchen is recorded.",
    knows="The log's poses.",
    does_not_show="Other machines, other logs. One run of each; seconds by step are of a step's whole process.",
    arms={"before": "before", "ours": "ours"},
    default_arms=lambda bench: ["ours"] if bench.parameters.before is None else ["before", "ours"],
    cases=BACKENDS,
    default_cases=lambda bench: ["geometric"] if bench.quick else BACKENDS,
    reporting=("1",),
    together=lambda trial: trial.case,
    measure=measure,
    record=dict[str, float],
    measures={name: only(name, unit) for name, unit in UNITS.items()},
    parameters=ReconstructParameters,
    places=frozenset({"log", "weights"}),
    inputs=lambda bench, trial: [bench.parameters.log],
    quick={"frames": 20},
    steps=("ingest", "segment", "articulate", "fuse", "graph", "library build", "cad", "urdf", "evaluate", "report"),
)

"""From a log to an interactive scene: seconds by step, frames a second, memory; this code and one of before in turn.

    python -m benchmarks.speed.reconstruct --out FOLDER [--before FOLDER] [--log LOG] [--weights ONNX] [--frames N]

Runs `scenewright run reconstruct` on every frame of a recorded log for three backends, with the CAD library made before
(runs share it), by this code and by the checkout of earlier code in `--before`, one after the other for each backend.
Nothing else should run beside it. Artifacts of both codes are compared by their content digests. FOLDER/figures.json is
docs/results/speed_reconstruct.json.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.schemas.places import HOME
from scenewright.stages.engine.batch.processes import descendants, resident_memory
from scenewright.stages.kit.measurement.tables import Table, as_markdown

from benchmarks.options import Measurement, asked
from benchmarks.results import circumstances, write_measured
from benchmarks.tabulation import Figure

BACKENDS = ("auto", "detector", "geometric")
QUICK_FRAMES = 20
FIRST_FRAMES = 8
"""Of a run before each that is measured, in which numba compiles what has changed."""
SECONDS_BETWEEN_LOOKS = 0.2
PEAKS = ("peak memory", "peak memory, shared pages for each")


class ReconstructMeasurement(Measurement):
    """Options of the measurement."""

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


def measure(arguments: ReconstructMeasurement) -> dict[str, float]:
    """Return the figures of all backends and codes: `<code>/<backend>/<measure>`."""
    frames = arguments.frames or (QUICK_FRAMES if arguments.quick else None)
    codes = {"ours": HOME}
    if arguments.before is not None:
        if not (arguments.before / ".venv" / "bin" / "python").exists():
            raise UsageError(f"{arguments.before}: no checkout with a .venv", hint="git worktree add, link .venv")
        codes = {"before": arguments.before.resolve(), **codes}
    out = (arguments.out or Path("outputs/speed-reconstruct")).resolve()
    found: dict[str, float] = {}
    for backend in ("geometric",) if arguments.quick else BACKENDS:
        settings = {"log": str(arguments.log.resolve()), "backend": backend, "every": "1"}
        if backend == "detector":
            settings["weights"] = str(arguments.weights.resolve())
        if frames is not None:
            settings["max_frames"] = str(frames)
        runs = {}
        for name, code in codes.items():
            _make_library(code, out / name)
            print(f"{backend}, {name} ...", file=sys.stderr, flush=True)
            run_once(code, out / name / "compiling", {**settings, "max_frames": str(FIRST_FRAMES)})
            runs[name] = run = run_once(code, out / name / backend, settings)
            used = run.steps["sequence"]["summary"]["frames"]
            found |= {
                f"{name}/{backend}/frames": used,
                f"{name}/{backend}/whole": run.seconds,
                f"{name}/{backend}/frames per s": used / run.seconds,
                f"{name}/{backend}/processor time": run.processor_seconds,
                f"{name}/{backend}/{PEAKS[0]}": run.peak_memory / 1e6,
                f"{name}/{backend}/{PEAKS[1]}": run.peak_resident / 1e6,
                **{f"{name}/{backend}/{step}": facts["seconds"] for step, facts in run.steps.items()},
            }
        if "before" in runs:
            digests = [{step: facts["content_digest"] for step, facts in run.steps.items()} for run in runs.values()]
            same = [step for step in digests[1] if digests[0].get(step) == digests[1][step]]
            print(f"{backend}: other bytes: {sorted(set(digests[1]) - set(same)) or 'none'}", file=sys.stderr)
            found[f"ours/{backend}/same artifacts"] = len(same)
        (out / "metrics-so-far.json").write_text(json.dumps(found, indent=1))
    return found


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


def main() -> None:
    """Measure, print the table, write metrics.json and table.md."""
    arguments = asked(ReconstructMeasurement)
    metrics = measure(arguments)
    rows = tuple(metrics.items())
    table = Table("reconstruct", "From a log to an interactive scene", ("", "value"), rows)
    write_measured(arguments.out, metrics, as_markdown(table))
    if arguments.out is not None:
        text = json.dumps(published(metrics), indent=1, ensure_ascii=False)
        (arguments.out / "figures.json").write_text(text + "\n", encoding="utf-8")


def published(metrics: dict[str, float]) -> dict[str, Any]:
    """Return the figures with what has to stand beside them (docs/results/index.md)."""
    units = {"frames": "", "frames per s": "", "same artifacts": ""} | dict.fromkeys(PEAKS, "MB")
    figures = {
        name: vars(Figure(round(value, 2), None, None, 1, units.get(name.rpartition("/")[2], "s")))
        for name, value in metrics.items()
    }
    return {
        "experiment": "speed_reconstruct",
        "title": "From a log to an interactive scene",
        **circumstances(["python", "-m", "benchmarks.speed.reconstruct", "--out", "FOLDER", "--before", "CHECKOUT"]),
        "simulated": "nothing: the kitchen is recorded",
        "knows": "the log's poses",
        "does_not_show": "Other machines, other logs. One run of each; seconds by step are of a step's whole process.",
        "figures": figures,
    }


if __name__ == "__main__":
    main()

"""Small batches for the tests: a pipeline of one step, log files that say how their scene behaves."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

from scenewright.stages.engine.batch.expansion import Batch, PlannedRun, read_batch
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult

PROGRAM = Path(__file__).with_name("scene_program.py")
PROGRAM_MODULE = "tests.unit.batch.scene_program"
PIPELINE = """
name = "tiny"
summary = "one step"
[variables.log]
description = "a log"
[variables.seed]
description = "seed"
default = "0"
[variables.every]
description = "use every n-th frame"
default = "1"
[variables.weights]
description = "never used"
optional = true
[[step]]
name = "sequence"
stage = "ingest"
inputs = { log = "$log" }
parameters = { every = "$every" }
seed = "$seed"
"""


def write_batch(folder: Path, behaviours: dict[str, str], text: str = "", head: str = "") -> Path:
    """Write a pipeline, a log file per behaviour and a batch file with [data]; returns the batch file.

    `head` are top-level keys, `text` are tables.
    """
    (folder / "logs").mkdir(parents=True, exist_ok=True)
    for name, behaviour in behaviours.items():
        (folder / "logs" / f"{name}.txt").write_text(behaviour)
    (folder / "tiny.toml").write_text(PIPELINE)
    path = folder / "batch.toml"
    path.write_text(f'pipeline = "tiny.toml"\n{head}\n[data]\nvariable = "log"\nglob = "logs/*.txt"\n{text}\n')
    return path


def batch_of(folder: Path, behaviours: dict[str, str], text: str = "", head: str = "") -> Batch:
    """Write a batch and read it."""
    return read_batch(write_batch(folder, behaviours, text, head))


def program_command(batch: Batch, run: PlannedRun, folder: Path, *, force: bool) -> tuple[str, ...]:
    """Run scene_program.py instead of scenewright; -S -I make it start fast."""
    values = [str(run.values["log"]), str(run.values["seed"])]
    return (sys.executable, "-I", "-S", str(PROGRAM), str(folder), *values)


def module_command(batch: Batch, run: PlannedRun, folder: Path, *, force: bool) -> tuple[str, ...]:
    """Run scene_program.py as a module, as scenewright is run."""
    values = [str(run.values["log"]), str(run.values["seed"])]
    return (sys.executable, "-m", PROGRAM_MODULE, str(folder), *values)


def job(name: str, **changes: object) -> Job:
    """Return a job with plain values."""
    facts = {"name": name, "scene": name, "folder": f"/nowhere/{name}", "command": ("true",), "steps": ("sequence",)}
    return Job.model_validate(facts | {"fingerprint": f"f-{name}"} | changes)


def result(name: str, outcome: str = "done", **changes: object) -> SceneResult:
    """Return a result with plain values."""
    codes = {"done": 0, "not ok": 4, "bad input": 3, "crash": 1}
    facts = {"job": name, "scene": name, "fingerprint": f"f-{name}", "outcome": outcome, "seconds": 1.0}
    return SceneResult.model_validate(facts | {"exit_code": codes.get(outcome, 6)} | changes)


def lines_of(path: Path) -> list[dict]:
    """Return the objects of a file of JSON lines."""
    return [json.loads(line) for line in path.read_text().splitlines()]


class FakeExecutor:
    """Ends jobs at once with the result that `play` gives, `capacity` at a time."""

    def __init__(self, capacity: int = 2, play: Callable[[Job], SceneResult] = lambda job: result(job.name)) -> None:
        self.size = capacity
        self.play = play
        self.held: list[Job] = []
        self.most_held = 0
        self.order: list[str] = []
        self.cancelled = False
        self.closed = 0

    def capacity(self) -> int:
        """Return the size."""
        return self.size

    def submit(self, job: Job) -> None:
        """Hold the job."""
        self.held.append(job)
        self.order.append(job.name)
        self.most_held = max(self.most_held, len(self.held))

    def completed(self, timeout: float) -> list[SceneResult]:
        """End the oldest job."""
        return [self.play(self.held.pop(0))] if self.held else []

    def cancel(self) -> None:
        """Forget what is held."""
        self.cancelled = True
        self.held.clear()

    def close(self) -> None:
        """Count the calls."""
        self.closed += 1

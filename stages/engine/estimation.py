"""Whether a step, or a whole pipeline, fits on this machine before it starts, by the estimates that steps declare.

In a pipeline every step's estimate is the next one's input.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from scenewright.schemas.errors import BadInput, MachineFailure
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.discovery import stage_by_name
from scenewright.stages.engine.pipelines import Pipeline, Step
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.kit.estimates import MEGABYTE, Estimate, size
from scenewright.stages.kit.stage import External, Optionally, Stage

logger = logging.getLogger("scenewright")


def estimate_step(stage: Stage, parameters: Any, paths: Mapping[str, Path]) -> Estimate | None:
    """Return the estimate of a step for inputs on the disk, role -> path; None when nothing can be said."""
    if stage.estimate is None:
        return None
    try:
        return stage.estimate(parameters, {role: measured(path) for role, path in paths.items()})
    except (BadInput, OSError):
        return None  # an estimate never stops a step: whoever opens the input says what is wrong with it


def measured(path: Path) -> Estimate:
    """Return how much an input on the disk holds: an artifact by its manifest, a raw file or folder by its size.

    Raises OSError when it is not there.
    """
    path = Path(path)
    for root in (path, path.parent):
        if (root / MANIFEST_NAME).is_file():
            try:
                artifact = open_artifact(root)
                frames, megapixels = artifact.pictures() or (None, None)
            except BadInput:
                break
            assert artifact.manifest is not None
            megabytes = sum(record.bytes for record in artifact.manifest.files) / MEGABYTE
            return Estimate(megabytes, megabytes, frames=frames, megapixels=megapixels)
    files = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
    megabytes = sum(file.stat().st_size for file in files) / MEGABYTE
    return Estimate(megabytes, megabytes)


def free_bytes(out: Path) -> int:
    """Return the free space where `out` is going to stand [bytes]."""
    folder = Path(os.path.abspath(out)).parent
    while not folder.exists():
        folder = folder.parent
    return shutil.disk_usage(folder).free


def available_memory() -> int:
    """Return the memory that is available now without swapping [bytes]."""
    import psutil

    return psutil.virtual_memory().available


def warn_or_refuse(what: str, expected: Estimate | None, out: Path) -> None:
    """Log a warning when what was estimated may not fit on this machine.

    Raises MachineFailure when not even the least fits on the disk.
    """
    if expected is None:
        return
    free, memory = free_bytes(out), available_memory()
    if free < expected.disk_lower:
        raise MachineFailure(
            f"{what} writes at least {size(expected.disk_lower)}, and {size(free)} are free at {out}",
            hint="free space (scenewright gc) or choose another --out",
        )
    if free < expected.disk:
        logger.warning("%s may fill the disk: %s expected, %s are free at %s", what, expected, size(free), out)
    if memory < expected.memory:
        logger.warning("%s may run out of memory: %s expected, %s available", what, size(expected.memory), size(memory))


@dataclass(frozen=True)
class RunEstimate:
    """What a pipeline is expected to write and use."""

    steps: dict[str, Estimate | None]
    """Step -> estimate; None where the step declares none, or where its input or parameters cannot be known yet."""
    there: frozenset[str]
    """Steps whose artifact stands there; it may be up to date, and is replaced one by one if not."""

    @property
    def total(self) -> Estimate:
        """What is not there yet, all together, and the most memory that one step uses."""
        coming = [estimate for name, estimate in self.steps.items() if estimate is not None and name not in self.there]
        memory = max((estimate.mebibytes for estimate in coming), default=0.0)
        return Estimate(
            sum(estimate.megabytes for estimate in coming), sum(estimate.lower for estimate in coming), memory
        )

    def lines(self) -> list[str]:
        """Say it, step by step."""
        rows = [
            f"{name:24} {'is there' if name in self.there else estimate or 'nothing is known'}"
            for name, estimate in self.steps.items()
        ]
        return [*rows, f"{'to write':24} {self.total}"]

    def as_json(self) -> dict[str, Any]:
        """Return the figures in bytes, for --json."""
        step_estimates = {
            name: e.as_json() for name, e in self.steps.items() if e is not None and name not in self.there
        }
        return {"total": self.total.as_json(), "steps": step_estimates}


def estimate_pipeline(
    pipeline: Pipeline, run_folder: Path, values: Mapping[str, str | None], only: tuple[str, ...] = ()
) -> RunEstimate:
    """Estimate every step that would run. `values` are the variables of the pipeline."""
    holds: dict[str, Estimate] = {}
    steps: dict[str, Estimate | None] = {}
    present = frozenset(step.name for step in pipeline.step if (run_folder / step.name / MANIFEST_NAME).is_file())
    for step in pipeline.step:
        expected = _estimate_in_pipeline(step, values, holds)
        if step.name in present:
            holds[step.name] = measured(run_folder / step.name)
        elif expected is not None:
            holds[step.name] = expected
        if not only or step.name in only:
            steps[step.name] = expected
    return RunEstimate(steps, present)


def _estimate_in_pipeline(
    step: Step, values: Mapping[str, str | None], holds: Mapping[str, Estimate]
) -> Estimate | None:
    stage = stage_by_name(step.stage)
    if stage.estimate is None:
        return None
    inputs = {}
    for role, source in step.inputs.items():
        declared = stage.reads[role]
        kind = declared.what if isinstance(declared, Optionally) else declared
        if isinstance(kind, External) and kind.weights:
            continue  # perhaps a name in the cache; no output depends on its size
        if not source.startswith("$"):
            inputs[role] = holds.get(source.split("/")[0], Estimate(0.0, 0.0))
        elif (value_of_variable := values[source[1:]]) is not None:
            if not Path(value_of_variable).exists():
                return None
            inputs[role] = measured(Path(value_of_variable))
    settings = {name: _value(value, values) for name, value in step.parameters.items()}
    try:
        parameters = stage.parameters(**{name: value for name, value in settings.items() if value is not None})
    except ValidationError:
        return None  # the step itself says what is wrong
    return stage.estimate(parameters, inputs)


def _value(value: Any, values: Mapping[str, str | None]) -> Any:
    return values[value[1:]] if isinstance(value, str) and value[1:] in values and value[0] == "$" else value

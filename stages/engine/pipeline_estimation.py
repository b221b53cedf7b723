"""What a whole pipeline is going to write, before its first step: every step's estimate is the next one's input."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from schemas.manifest import MANIFEST_NAME
from stages.engine.discovery import stage_by_name
from stages.engine.estimation import Amount, Estimate, check, estimate, measured
from stages.engine.pipelines import Pipeline, Step
from stages.kit.stage import External, Optionally

logger = logging.getLogger("scenewright")
_VARIABLE = re.compile(r"^\$([a-z_]+)$")
NOTHING = Amount(0.0, 0.0)


@dataclass(frozen=True)
class StepEstimate:
    """One step of the pipeline."""

    name: str
    there: bool
    """Whether an artifact stands there; it may be up to date, and is replaced one by one if not."""
    estimate: Estimate | None
    """None where nobody measured the step, or where its input or parameters cannot be known yet."""


@dataclass(frozen=True)
class RunEstimate:
    """What a run is expected to write and use."""

    steps: tuple[StepEstimate, ...]

    @property
    def total(self) -> Estimate:
        """What is not there yet, all together, and the most memory that one step uses."""
        coming = [step.estimate for step in self.steps if step.estimate is not None and not step.there]
        disk = Amount(sum(e.output.megabytes for e in coming), sum(e.output.lower for e in coming))
        return Estimate(disk, max((e.memory for e in coming), default=0.0))

    def lines(self) -> list[str]:
        """Say it, step by step."""
        rows = []
        for step in self.steps:
            rows.append(f"{step.name:24} {'is there' if step.there else step.estimate or 'nothing is known'}")
        return [*rows, f"{'to write':24} {self.total}"]

    def as_json(self) -> dict[str, Any]:
        """Return the figures in bytes, for --json."""
        known = {s.name: s.estimate.as_json() for s in self.steps if s.estimate is not None and not s.there}
        return {"total": self.total.as_json(), "steps": known}


def warn_or_refuse(
    pipeline: Pipeline, run_folder: Path, values: Mapping[str, str | None], only: tuple[str, ...] = ()
) -> RunEstimate:
    """Estimate a run, and log a warning when it may not fit. Raises MachineFailure when it cannot."""
    expected = estimate_pipeline(pipeline, run_folder, values, only)
    for warning in check(f"pipeline {pipeline.name}", expected.total, run_folder):
        logger.warning("%s", warning)
    return expected


def estimate_pipeline(
    pipeline: Pipeline, run_folder: Path, values: Mapping[str, str | None], only: tuple[str, ...] = ()
) -> RunEstimate:
    """Estimate every step that would run. `values` are the variables of the pipeline."""
    amounts: dict[str, Amount] = {}
    found = []
    for step in pipeline.step:
        there = (run_folder / step.name / MANIFEST_NAME).is_file()
        expected = _estimate_step(step, values, amounts)
        if there:
            amounts[step.name] = measured(run_folder / step.name)
        elif expected is not None:
            amounts[step.name] = expected.output
        if not only or step.name in only:
            found.append(StepEstimate(step.name, there, expected))
    return RunEstimate(tuple(found))


def _estimate_step(step: Step, values: Mapping[str, str | None], amounts: Mapping[str, Amount]) -> Estimate | None:
    stage = stage_by_name(step.stage)
    inputs = {}
    for role, source in step.inputs.items():
        declared = stage.reads[role]
        what = declared.what if isinstance(declared, Optionally) else declared
        if isinstance(what, External) and what.weights:
            continue  # perhaps a name in the cache; no output depends on its size
        match = _VARIABLE.match(source)
        if match is None:
            inputs[role] = amounts.get(source.split("/")[0], NOTHING)
        elif values[match[1]] is not None:
            path = Path(str(values[match[1]]))
            if not path.exists():
                return None
            inputs[role] = measured(path)
    parameters = {}
    for name, value in step.parameters.items():
        match = _VARIABLE.match(value) if isinstance(value, str) else None
        chosen = values[match[1]] if match else value
        if chosen is not None:
            parameters[name] = chosen
    try:
        return estimate(stage.name, stage.parameters(**parameters), inputs)
    except ValidationError:
        return None  # the step itself says what is wrong

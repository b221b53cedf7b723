"""Running a pipeline: every step is its own process, with the same command line that make uses.

Inside `forked_steps` the process is a fork: `run` loads numpy, trimesh
and Open3D once and not for each step.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.stages.engine import forking
from scenewright.stages.engine.interruption import PARENT_VARIABLE
from scenewright.stages.engine.own_code import own_code
from scenewright.stages.engine.pipelines import Pipeline, Step, resolve_variables, step_arguments, step_modules

OUTCOME_EXIT_CODE = 4
"""An artifact was written, but its outcome is not ok."""


@dataclass(frozen=True)
class StepReport:
    """What one step of a run said."""

    name: str
    exit_code: int
    facts: dict[str, Any]

    def code(self, accept: Collection[str] = ()) -> int:
        """Return its exit code; 4 where it ended with 0 because the pipeline goes on after an outcome that is neither
        ok nor one of `accept`."""
        outcome = self.facts.get("outcome", "ok")
        if self.exit_code == 0 and outcome not in ("ok", "unknown", *accept):
            return OUTCOME_EXIT_CODE
        return self.exit_code


def command_prefix() -> list[str]:
    """Return the words that start scenewright in a new process, whatever the working folder."""
    return [sys.executable, "-m", "scenewright"]


def run_command(arguments: list[str]) -> tuple[int, str]:
    """Run one scenewright command; progress and messages pass through, standard output is returned."""
    command = [*command_prefix(), *arguments]
    own = {**own_code(), PARENT_VARIABLE: str(os.getpid())}
    if forking.forks():
        return forking.run_forked(command, own)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, **own})
    try:
        output, _ = process.communicate()
    except KeyboardInterrupt:
        process.terminate()
        process.wait()
        raise
    return process.returncode, output


def forked_steps(pipeline: Pipeline, only: Collection[str] = ()) -> AbstractContextManager[None]:
    """Let this process run its steps in forks of itself inside, where that is safe, with their code loaded once."""
    return forking.begun(step_modules(pipeline, only)) if sys.platform == "linux" else nullcontext()


def run_pipeline(
    pipeline: Pipeline,
    run_folder: Path,
    given: Mapping[str, str],
    *,
    extra: tuple[str, ...] = (),
    only: tuple[str, ...] = (),
    announce: Callable[[str], None] = lambda text: None,
    execute: Callable[[list[str]], tuple[int, str]] = run_command,
) -> list[StepReport]:
    """Run the steps in order and stop at the first that does not exit with 0.

    `extra` words are added to every command (`--dry-run`, `--force`). A dry run stops at the first step that would
    run, as what follows depends on its result.

    Raises UsageError for unknown or missing variables, BadInput after a step whose artifact lacks what the pipeline
    needs of it.
    """
    values = resolve_variables(pipeline, given)
    reports = []
    for number, step in enumerate(pipeline.step, start=1):
        if only and step.name not in only:
            continue
        announce(f"[{number}/{len(pipeline.step)}] {step.name}")
        code, output = execute([*step_arguments(step, str(run_folder), values), "--json", *extra])
        try:
            facts = json.loads(output) if output.strip() else {}
        except json.JSONDecodeError:
            facts = {}
        reports.append(StepReport(step.name, code, facts))
        if code == 0:
            _check_needs(step, facts)
        if code != 0 or facts.get("status") == "would run":
            break
    return reports


def _check_needs(step: Step, facts: Mapping[str, Any]) -> None:
    summary = facts.get("summary", {})
    for name, remedy in step.needs.items():
        if summary.get(name, 1) == 0:
            raise BadInput(f"{step.name}: {name} is 0", hint=remedy)

"""Pipelines, declared once in data/pipelines/<name>.toml; `scenewright run` and make execute the same commands."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError
from scenewright.schemas.errors import UsageError, first_problem
from scenewright.schemas.places import data_file
from scenewright.stages.engine.discovery import all_stages, package_of, stage_by_name
from scenewright.stages.kit.configuration import read_toml
from scenewright.stages.kit.stage import Stage

PIPELINES_FOLDER = data_file("pipelines")
_VARIABLE = re.compile(r"^\$([a-z_]+)$")
SHARED_FOLDER = ".shared"
_NAME = re.compile(r"^[a-z][a-z0-9_]*$")


class Variable(BaseModel):
    """A value the user gives: `--set name=value`, or NAME=value for make."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    description: str
    default: str | None = None
    optional: bool = False
    """Without a value, the input or parameter that names it is left out."""


class Step(BaseModel):
    """One command of the pipeline."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: str
    """Folder of the artifact in the run."""
    stage: str
    inputs: dict[str, str] = {}
    """Role -> name of an earlier step, or `$variable`."""
    parameters: dict[str, Any] = {}
    """Parameter -> value, or `$variable`."""
    seed: int | str | None = None
    accept: tuple[str, ...] = ()
    """Outcomes after which the chain goes on; `run` ends with 4 all the same, unless its user accepts them too."""
    shared: bool = False
    """Taken from the folder `.shared` beside the run folder where another run has made the same."""
    needs: dict[str, str] = {}
    """Entry of the artifact's summary -> what to do when it is 0: `run` then stops with 3 after this step."""


class Pipeline(BaseModel):
    """A chain of steps."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: str
    summary: str
    variables: dict[str, Variable] = {}
    step: tuple[Step, ...]


def pipeline_path(name_or_path: str) -> Path:
    """Return the file of a pipeline given by name (data/pipelines) or by path. Raises UsageError."""
    for candidate in (Path(name_or_path), PIPELINES_FOLDER / f"{name_or_path}.toml"):
        if os.path.isfile(candidate):
            return candidate
    names = ", ".join(sorted(p.stem for p in PIPELINES_FOLDER.glob("*.toml")))
    if os.path.exists(name_or_path):
        raise UsageError(f"{name_or_path}: not a regular file", hint="a pipeline is a TOML file")
    raise UsageError(f"no pipeline {name_or_path!r:.200}", hint=f"give a TOML file or one of: {names}")


def read_pipeline(path: Path) -> Pipeline:
    """Read and check a pipeline: known stages and parameters, inputs of the right kind. Raises UsageError."""
    values = read_toml(path, hint="a pipeline is a TOML file")
    try:
        pipeline = Pipeline.model_validate(values)
    except ValidationError as error:
        raise UsageError(f"{path}: {first_problem(error)}", hint="see docs") from None
    done: dict[str, Stage] = {}
    for step in pipeline.step:
        if not _NAME.match(step.name):
            raise UsageError(f"{path}: step {step.name!r}: not a name", hint="use lower case letters and underscores")
        if step.name in done:
            raise UsageError(f"{path}: two steps are called {step.name!r}", hint="rename one")
        stage = stage_by_name(step.stage)
        _check_step(path, pipeline, step, stage, done)
        done[step.name] = stage
    return pipeline


def _check_step(path: Path, pipeline: Pipeline, step: Step, stage: Stage, done: Mapping[str, Stage]) -> None:
    where = f"{path}: step {step.name!r}"
    for name in step.parameters:
        if name not in stage.parameters.model_fields:
            raise UsageError(f"{where}: {stage.name} has no parameter {name!r}", hint="see its --help")
    values = [*step.inputs.values(), *(v for v in step.parameters.values() if isinstance(v, str)), str(step.seed or "")]
    for value in values:
        match = _VARIABLE.match(value)
        if match and match[1] not in pipeline.variables:
            raise UsageError(f"{where}: variable {value} is not declared", hint="declare it under [variables]")
    for role, source in step.inputs.items():
        if role not in stage.reads:
            raise UsageError(f"{where}: {stage.name} has no input {role!r}", hint=f"inputs: {', '.join(stage.reads)}")
        if not _VARIABLE.match(source) and source.split("/")[0] not in done:
            raise UsageError(
                f"{where}: input {role!r} comes from {source!r}, which is not an earlier step", hint="reorder"
            )
    if step.shared and step.inputs:
        raise UsageError(f"{where}: a shared step has no inputs", hint="leave `shared` out")
    missing = [role for role in stage.required() if role not in step.inputs]
    if missing:
        raise UsageError(f"{where}: input {missing[0]!r} is missing", hint=f"{stage.name} needs it")


def step_modules(pipeline: Pipeline, only: Collection[str] = ()) -> list[str]:
    """Return the module that each of its steps runs, or those of the steps `only`."""
    stages = [stage_by_name(step.stage) for step in pipeline.step if not only or step.name in only]
    return [f"{package_of(stage)}.{stage.module}" for stage in stages]


def resolve_variables(pipeline: Pipeline, given: Mapping[str, str]) -> dict[str, str | None]:
    """Fill in defaults. Raises UsageError for unknown or missing variables."""
    unknown = sorted(set(given) - set(pipeline.variables))
    if unknown:
        variables = ", ".join(pipeline.variables) or "none"
        raise UsageError(f"pipeline {pipeline.name} has no variable {unknown[0]!r}", hint=f"it has: {variables}")
    values: dict[str, str | None] = {}
    for name, variable in pipeline.variables.items():
        value = given.get(name) or variable.default
        if value is None and not variable.optional:
            raise UsageError(
                f"pipeline {pipeline.name} needs {name} ({variable.description})", hint=f"--set {name}=..."
            )
        values[name] = value
    return values


def step_arguments(step: Step, run_folder: str, values: Mapping[str, str | None]) -> list[str]:
    """Return the command line (after `scenewright`) of one step. Paths of artifacts are inside `run_folder`."""
    stage = all_stages()[step.stage]
    arguments = stage.name.split()
    for role, source in step.inputs.items():
        match = _VARIABLE.match(source)
        path = values[match[1]] if match else f"{run_folder}/{source}"
        if path is not None:
            arguments += [f"--{role.replace('_', '-')}", path]
    for name, value in step.parameters.items():
        match = _VARIABLE.match(value) if isinstance(value, str) else None
        arguments += _option(name, values[match[1]] if match else value)
    if step.seed is not None:
        match = _VARIABLE.match(str(step.seed))
        arguments += _option("seed", values[match[1]] if match else step.seed)
    for outcome in step.accept:
        arguments += ["--accept", outcome]
    if step.shared:
        arguments += ["--shared", f"{run_folder}/../{SHARED_FOLDER}"]
    return [*arguments, "--out", f"{run_folder}/{step.name}"]


def _option(name: str, value: Any) -> list[str]:
    option = name.replace("_", "-")
    if value is None:
        return []
    if isinstance(value, bool):
        return [f"--{option}" if value else f"--no-{option}"]
    if isinstance(value, list | tuple):
        return [word for item in value for word in (f"--{option}", str(item))]
    return [f"--{option}", str(value)]

"""From a batch file to the runs it asks for: scenes x parameter sets x seeds, all checked before anything runs."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.batch.data_sets import find_scenes
from scenewright.stages.engine.batch.fingerprints import (
    absolute_inputs,
    file_state,
    fingerprint,
    input_variables,
    pipeline_facts,
)
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.names import is_folder_name
from scenewright.stages.engine.batch.spec import BatchSpec, ParameterSet, read_spec
from scenewright.stages.engine.pipelines import Pipeline, pipeline_path, read_pipeline, resolve_variables


@dataclass(frozen=True)
class PlannedRun:
    """One run of the pipeline: where it goes and with which values of the variables."""

    name: str
    scene: str
    parameters: str | None
    seed: int | None
    settings: dict[str, str]
    """What is given by `--set`."""
    values: dict[str, str | None]
    """All variables, defaults included."""


@dataclass(frozen=True)
class Batch:
    """A batch file that has been read and checked."""

    path: Path
    spec: BatchSpec
    pipeline: Pipeline
    pipeline_file: Path
    runs: tuple[PlannedRun, ...]
    """In the order of the file; `shuffled` gives the order of execution."""


def _pipeline_file(name: str, base: Path) -> Path:
    """A pipeline file beside the batch file comes before one given from the working folder or by name."""
    beside = base / name
    return Path(os.path.abspath(beside if beside.is_file() else pipeline_path(name)))


def _check_names(names: Sequence[str], item_kind: str, where: str, refused: Sequence[str] = ()) -> None:
    taken_names: set[str] = set()
    for name in names:
        if not is_folder_name(name) or name.casefold() in taken_names or name in refused:
            raise UsageError(f"{where}: {item_kind} {name!r}: not a unique folder name", hint="rename it")
        taken_names.add(name.casefold())


def _merge(groups: Sequence[tuple[str, Mapping[str, str]]], where: str) -> dict[str, str]:
    """Join settings that must not contradict each other. Raises UsageError naming both sources."""
    merged: dict[str, str] = {}
    source: dict[str, str] = {}
    for name, settings in groups:
        for variable, value in settings.items():
            if variable in merged:
                raise UsageError(
                    f"{where}: {variable!r} is set by {source[variable]} and by {name}", hint="keep one of them"
                )
            merged[variable], source[variable] = value, name
    return merged


def _check_variables(spec: BatchSpec, pipeline: Pipeline, where: str) -> None:
    """Refuse variables that the pipeline has not, naming the table that sets them."""
    tables: list[tuple[str, Sequence[str]]] = [("set", tuple(spec.set))]
    tables += [(f"scene {scene.name!r}", tuple(scene.set)) for scene in spec.scene]
    tables += [(f"parameters {entry.name!r}", tuple(entry.set)) for entry in spec.parameters]
    tables += [("data", (spec.data.variable,))] if spec.data else []
    tables += [("seeds", (spec.seed_variable,))] if spec.seeds else []
    variable_names = ", ".join(pipeline.variables) or "none"
    for table, variables in tables:
        for variable in variables:
            if variable not in pipeline.variables:
                raise UsageError(
                    f"{where}: {table}: pipeline {pipeline.name} has no variable {variable!r}",
                    hint=f"it has: {variable_names}",
                )


def read_batch(path: Path) -> Batch:
    """Read a batch file and expand it into runs. Raises UsageError for anything wrong, before anything has run."""
    path = Path(os.path.abspath(path))
    spec = read_spec(path)
    where, base = str(path), path.parent
    pipeline_file = _pipeline_file(spec.pipeline, base)
    pipeline = read_pipeline(pipeline_file)
    _check_variables(spec, pipeline, where)
    scenes: list[tuple[str, str, dict[str, str]]] = [
        (scene.name, f"scene {scene.name!r}", dict(scene.set)) for scene in spec.scene
    ]
    _check_names([name for name, _, _ in scenes], "scene", where)
    if spec.data is not None:
        scenes_of_data = find_scenes(spec.data, base, where)
        scenes += [(name, "data", {spec.data.variable: str(scene_path)}) for name, scene_path in scenes_of_data]
        _check_names([name for name, _, _ in scenes], "scene", where)
    if not scenes:
        raise UsageError(f"{where}: no scene", hint="give [[scene]] or [data]; see docs/BATCH.md")
    # Beside the folders of parameter sets stand, after a change of the batch file, those of steps and seeds.
    reserved = [*(step.name for step in pipeline.step), *(f"seed-{seed}" for seed in spec.seeds)]
    _check_names([entry.name for entry in spec.parameters], "parameters", where, reserved)
    if len(set(spec.seeds)) < len(spec.seeds):
        raise UsageError(f"{where}: seeds: one is there twice", hint="each seed once")
    paths = input_variables(pipeline)
    conditions: Sequence[ParameterSet | None] = spec.parameters or (None,)
    seeds: Sequence[int | None] = spec.seeds or (None,)
    runs = []
    for scene, source, scene_settings in scenes:
        for condition in conditions:
            for seed in seeds:
                sources = [(source, scene_settings)]
                sources += [(f"parameters {condition.name!r}", condition.set)] if condition else []
                sources += [("seeds", {spec.seed_variable: str(seed)})] if seed is not None else []
                settings = absolute_inputs({**spec.set, **_merge(sources, where)}, paths, base)
                name_parts = (scene, condition.name if condition else None, None if seed is None else f"seed-{seed}")
                try:
                    values = resolve_variables(pipeline, settings)
                except UsageError as error:
                    raise UsageError(f"{where}: scene {scene!r}: {error.message}", hint=error.hint) from None
                runs.append(
                    PlannedRun(
                        "/".join(p for p in name_parts if p),
                        scene,
                        condition.name if condition else None,
                        seed,
                        settings,
                        values,
                    )
                )
    _check_inputs_exist(runs, paths, where)
    return Batch(path, spec, pipeline, pipeline_file, tuple(runs))


def _check_inputs_exist(runs: Sequence[PlannedRun], paths: set[str], where: str) -> None:
    checked: set[str] = set()
    for run in runs:
        for variable in sorted(paths):
            value = run.values[variable]
            if value is None or value in checked:
                continue
            if not os.path.exists(value):
                raise UsageError(
                    f"{where}: scene {run.scene!r}: {variable} = {value}: no such file or folder",
                    hint="paths are relative to the batch file",
                )
            checked.add(value)


def shuffled(runs: Sequence[PlannedRun], seed: int) -> list[PlannedRun]:
    """Return the runs in an order that depends on the seed and their names alone.

    Sorting by a digest keeps the order of two runs whatever else the batch holds, also on a later run with more scenes.
    """
    return sorted(runs, key=lambda run: hashlib.sha256(f"{seed}/{run.name}".encode()).digest())


class SceneCommand(Protocol):
    """Returns the argument words that run a scene into a folder."""

    def __call__(self, batch: Batch, run: PlannedRun, folder: Path, *, force: bool) -> tuple[str, ...]:
        """See `scene_command`."""
        ...


def scene_command(batch: Batch, run: PlannedRun, folder: Path, *, force: bool) -> tuple[str, ...]:
    """Return the command line that runs a scene: what a person would type for this scene alone."""
    settings = [word for name, value in sorted(run.settings.items()) for word in ("--set", f"{name}={value}")]
    accepted = [word for outcome in batch.spec.accept for word in ("--accept", outcome)]
    words = [
        sys.executable,
        "-m",
        "scenewright",
        "run",
        str(batch.pipeline_file),
        "--out",
        str(folder),
        *settings,
        *accepted,
    ]
    return (*words, *(("--force",) if force else ()))


def make_jobs(batch: Batch, out: Path, *, force: bool = False, command: SceneCommand = scene_command) -> list[Job]:
    """Return the jobs of a batch in order of execution; run folders lie under `out`, which is made absolute."""
    out = Path(os.path.abspath(out))
    facts, paths, limits = pipeline_facts(batch.pipeline), input_variables(batch.pipeline), batch.spec.limits
    if batch.spec.accept:  # without it, what a batch before this key was there made stays as it is
        facts["accept"] = sorted(batch.spec.accept)
    storage = batch.spec.storage
    file_state_once = lru_cache(None)(file_state)
    jobs = []
    for run in shuffled(batch.runs, batch.spec.shuffle_seed):
        folder = out / run.name
        inputs = {value: file_state_once(value) for name in paths if (value := run.values[name]) is not None}
        jobs.append(
            Job(
                name=run.name,
                scene=run.scene,
                parameters=run.parameters,
                seed=run.seed,
                folder=str(folder),
                command=command(batch, run, folder, force=force),
                steps=tuple(step.name for step in batch.pipeline.step),
                fingerprint=fingerprint(facts, run.values, inputs),
                time_limit=limits.time,
                memory_limit=limits.memory,
                address_space=limits.address_space,
                grace=limits.grace,
                storage=f"{storage.url.rstrip('/')}/{run.name}" if storage else None,
                storage_timeout=storage.timeout if storage else 60.0,
                keep=storage is None or storage.keep,
            )
        )
    return jobs

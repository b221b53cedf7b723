"""Running the product's steps from an experiment: through the engine, with keys and manifests, never past it."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput
from scenewright.stages.engine.chain import run_command
from scenewright.stages.engine.discovery import package_of, stage_by_name
from scenewright.stages.engine.migration import migrate
from scenewright.stages.engine.reading import open_artifact, read_manifest
from scenewright.stages.engine.runner import run_stage
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context, Parameters

Kind = TypeVar("Kind", bound=Artifact)
Given = Mapping[str, Any] | Parameters
"""Parameters of a step: those that differ from its defaults, or all of them."""
EMPTY = 4
"""Exit code of a step whose artifact was written with another outcome than `ok`."""


class StepFailed(BadInput):
    """A step of a chain ended with this exit code."""

    def __init__(self, step: str, code: int) -> None:
        super().__init__(f"{step} ended with {code}", hint="see above")
        self.exit_code = code


def made(words: str, out: Path, *further: object) -> Path:
    """Run a scenewright command that writes `out` in a process of its own (nothing happens when it is up to date).

    An artifact without content is a result too. Raises StepFailed.
    """
    code, _ = run_command([*words.split(), *map(str, further), "--out", str(out), "--quiet"])
    if code not in (0, EMPTY):
        raise StepFailed(f"{words} ({out})", code)
    return out


def step(name: str, out: Path, given: Given | None = None, *, seed: int = 0, **inputs: Path) -> Path:
    """Run a step in this process through the engine, with the parameters `given`; nothing happens when it is up to
    date. Raises what `run_stage` raises."""
    stage = stage_by_name(name)
    run_stage(stage, inputs, out, stage.parameters.model_validate({} if given is None else dict(given)), seed=seed)
    return out


def unrecorded(
    name: str,
    out: Path,
    given: Given | None = None,
    *,
    seed: int = 0,
    progress: SilentProgress | None = None,
    **inputs: Artifact | Path,
) -> Any:
    """Run a step's `run` on artifacts that no step wrote (a map made of true surfaces), without a manifest."""
    stage = stage_by_name(name)
    values: dict[str, Artifact | Path | None] = dict.fromkeys(stage.reads)
    function = importlib.import_module(f"{package_of(stage)}.{stage.module}").run
    parameters = stage.parameters.model_validate({} if given is None else dict(given))
    return function(**{**values, **inputs}, parameters=parameters, context=context_in(out, seed, progress))


def opened(kind: type[Kind], path: Path) -> Kind:
    """Return the artifact at `path`, one of an older schema version migrated beside it: other versions of the program
    are measured too. Raises BadInput when it is missing, broken or of another kind."""
    manifest = read_manifest(path)
    if manifest.kind == kind.kind and manifest.schema_version < kind.schema_version:
        older, path = path, path.with_name(f"{path.name}-v{kind.schema_version}")
        if not path.is_dir():
            migrate(older, path)
    artifact = open_artifact(path, kind)
    assert isinstance(artifact, kind)
    return artifact


def context_in(folder: Path, seed: int = 0, progress: SilentProgress | None = None) -> Context:
    """Return a context that writes into `folder`, which is made where it is missing, without a word."""
    folder.mkdir(parents=True, exist_ok=True)
    return Context(folder, seed=seed, device="cpu", progress=progress or SilentProgress())

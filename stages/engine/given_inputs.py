"""What a user gives a pipeline, looked at before any step works: a wrong path is noticed at once, not an hour later."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.stages.engine.discovery import stage_by_name
from scenewright.stages.engine.model_cache import resolve_weights
from scenewright.stages.engine.pipelines import Pipeline
from scenewright.stages.kit.stage import External, Optionally


def given_inputs(pipeline: Pipeline, only: tuple[str, ...] = ()) -> Iterator[tuple[str, External]]:
    """Yield (variable, what it is) of the raw inputs of the steps (of `only` these when there are any)."""
    for step in pipeline.step:
        if only and step.name not in only:
            continue
        reads = stage_by_name(step.stage).reads
        for role, source in step.inputs.items():
            declared = reads[role]
            kind = declared.what if isinstance(declared, Optionally) else declared
            if source.startswith("$") and isinstance(kind, External):
                yield source[1:], kind


def check_given_inputs(pipeline: Pipeline, values: Mapping[str, str | None], only: tuple[str, ...] = ()) -> None:
    """Raise BadInput for a raw input that is not there, MissingDependency for weights that neither are nor are cached.

    `values` are the variables of the pipeline, defaults included.
    """
    for variable, kind in given_inputs(pipeline, only):
        value = values[variable]
        if value is None:
            continue
        if kind.weights:
            resolve_weights(Path(value))
        elif not _exists(Path(value)):
            raise BadInput(f"{variable} = {value}: no such file or folder", hint="check the path; nothing was run")


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # no permission, a name too long or with a zero byte
        return False

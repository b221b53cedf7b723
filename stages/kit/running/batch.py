"""A pipeline over a data set: one run folder per scene, one table, the worst exit code."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from schemas.errors import UsageError
from stages.kit.running.chain import StepReport, run_pipeline
from stages.kit.running.pipelines import Pipeline, pipeline_path, read_pipeline, resolve_variables


class Scene(BaseModel):
    """One run of the batch."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: str
    set: dict[str, str] = {}


class BatchSpec(BaseModel):
    """A batch file: the pipeline, values for all scenes, the scenes."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    pipeline: str
    set: dict[str, str] = {}
    scene: tuple[Scene, ...]


def read_batch(path: Path) -> tuple[BatchSpec, Pipeline]:
    """Read and check a batch file. Raises UsageError before anything has run."""
    try:
        with Path(path).open("rb") as file:
            spec = BatchSpec.model_validate(tomllib.load(file))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise UsageError(f"{path}: {error}", hint="a batch is a TOML file") from None
    except ValidationError as error:
        first = error.errors()[0]
        raise UsageError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}", hint="see docs") from None
    names = [scene.name for scene in spec.scene]
    for name in names:
        if names.count(name) > 1 or "/" in name or name.startswith("."):
            raise UsageError(f"{path}: scene {name!r}: not a unique folder name", hint="rename it")
    pipeline = read_pipeline(pipeline_path(spec.pipeline))
    for scene in spec.scene:
        resolve_variables(pipeline, {**spec.set, **scene.set})
    return spec, pipeline


def run_batch(
    spec: BatchSpec,
    pipeline: Pipeline,
    folder: Path,
    *,
    jobs: int = 1,
    extra: tuple[str, ...] = (),
    announce: Callable[[str], None] = lambda text: None,
) -> dict[str, list[StepReport]]:
    """Run every scene into `folder/<scene>`; one scene's failure does not stop the others."""

    def run_scene(scene: Scene) -> list[StepReport]:
        announce(f"scene {scene.name}")
        return run_pipeline(pipeline, folder / scene.name, {**spec.set, **scene.set}, extra=extra)

    with ThreadPoolExecutor(max_workers=jobs) as pool:
        return dict(zip([s.name for s in spec.scene], pool.map(run_scene, spec.scene), strict=True))


def worst_exit_code(codes: list[int]) -> int:
    """Return the gravest exit code: our bugs before machine failures, before inputs, before outcomes."""
    gravity = (0, 4, 2, 3, 5, 6, 130, 1)
    return max(codes, key=lambda code: gravity.index(code) if code in gravity else len(gravity), default=0)

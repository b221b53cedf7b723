"""What decides a scene's result, as far as it can be known without running anything."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenewright.schemas.base import canonical_json
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.discovery import stage_by_name
from scenewright.stages.engine.pipelines import Pipeline
from scenewright.stages.kit.digests import sha256_of_text
from scenewright.stages.kit.library_versions import library_version

State = tuple[int, int, int]


def file_state(path: str) -> State:
    """Return number of files, bytes in all and newest change [ns] of a file or folder; zeros when it is not there.

    Far cheaper than a digest, and enough to see that somebody touched a log: the steps' own keys hold the content.
    """
    if not os.path.isdir(path):
        try:
            facts = os.stat(path)
        except OSError:
            return 0, 0, 0
        return 1, facts.st_size, facts.st_mtime_ns
    count, size, newest = 0, 0, 0
    for folder, _, names in os.walk(path):
        for name in names:
            try:
                facts = os.stat(os.path.join(folder, name))
            except OSError:
                continue
            count, size, newest = count + 1, size + facts.st_size, max(newest, facts.st_mtime_ns)
    return count, size, newest


def pipeline_facts(pipeline: Pipeline) -> dict[str, Any]:
    """Return the declaration of a pipeline with the code of its steps."""
    return {
        "pipeline": pipeline.model_dump(mode="json"),
        "code": {step.stage: step_code(stage_by_name(step.stage)).digest for step in pipeline.step},
        "package": library_version("scenewright"),
    }


def fingerprint(facts: Mapping[str, Any], values: Mapping[str, str | None], inputs: Mapping[str, State]) -> str:
    """Return the sha256 over the pipeline, the resolved values and the state of the raw inputs (path -> state)."""
    return sha256_of_text(canonical_json({**facts, "values": dict(values), "inputs": dict(inputs)}))


def input_variables(pipeline: Pipeline) -> set[str]:
    """Return the variables that name raw inputs of some step: their values are paths."""
    return {
        source[1:]
        for step in pipeline.step
        for source in step.inputs.values()
        if source.startswith("$") and source[1:] in pipeline.variables
    }


def absolute_inputs(values: Mapping[str, str], paths: set[str], base: Path) -> dict[str, str]:
    """Return `values` with those of the variables in `paths` made absolute from `base`."""
    return {
        name: os.path.abspath(base / Path(value).expanduser()) if name in paths and value else value
        for name, value in values.items()
    }

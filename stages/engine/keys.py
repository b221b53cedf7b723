"""The key of an artifact: what decides its bytes. Same key on disk means nothing to do."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Mapping
from typing import Any

from scenewright.schemas.base import canonical_json
from scenewright.schemas.errors import UsageError
from scenewright.schemas.places import data_file
from scenewright.schemas.vocabulary import VOCABULARY_FILE
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.discovery import package_of
from scenewright.stages.kit.digests import sha256_of_file, sha256_of_text
from scenewright.stages.kit.library_versions import library_version
from scenewright.stages.kit.stage import Parameters, Stage

KEY_FORMAT = 2
"""Raised whenever what goes into the key changes."""


def library_versions(stage: Stage, parameters: Parameters) -> dict[str, str]:
    """Return the versions of the libraries that decide the step's output, and of what else does so (`versions`).

    Python is one of them: from 3.12 on its `sum` rounds less. Raises MissingDependency when that cannot be found out.
    """
    found = {"python": f"{sys.version_info.major}.{sys.version_info.minor}"}
    found |= {name: library_version(name) for name in stage.libraries}
    if stage.versions:
        found.update(importlib.import_module(f"{package_of(stage)}.{stage.versions}").versions(parameters))
    return dict(sorted(found.items()))


def data_file_digests(stage: Stage, parameters: Parameters) -> dict[str, str]:
    """Return name -> sha256 of the files of data/ that the step reads. Raises UsageError for a missing one."""
    names = (VOCABULARY_FILE.name, *(stage.data_files(parameters) if stage.data_files else ()))
    for name in names:
        if not data_file(name).is_file():
            raise UsageError(f"{stage.name}: data/{name} does not exist", hint="see the files of data/")
    return {name: sha256_of_file(data_file(name)) for name in names}


def parameters_as_json(parameters: Parameters) -> dict[str, Any]:
    """Return all parameters, defaults included, as plain JSON values."""
    return json.loads(parameters.model_dump_json())


def artifact_key(
    stage: Stage,
    parameters: Parameters,
    inputs: Mapping[str, str],
    seed: int,
    device_kind: str,
    libraries: Mapping[str, str] | None = None,
) -> str:
    """Return the key: sha256 of canonical JSON of all that decides the output.

    `inputs` maps role to content digest (artifacts) or file digest (raw inputs, weights). `libraries` are those of
    `library_versions`, when they are known already.
    """
    return sha256_of_text(
        canonical_json(
            {
                "key_format": KEY_FORMAT,
                "kind": stage.writes.kind,
                "schema_version": stage.writes.schema_version,
                "stage": stage.name,
                "code": step_code(stage).digest,
                "parameters": parameters_as_json(parameters),
                "inputs": dict(inputs),
                "seed": seed,
                "libraries": dict(libraries) if libraries is not None else library_versions(stage, parameters),
                "data_files": data_file_digests(stage, parameters),
                "device_kind": device_kind,
            }
        )
    )

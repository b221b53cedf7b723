"""Options of ingest as `name=value` words."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, get_origin

from scenewright.schemas.errors import UsageError
from scenewright.stages.ingest.parameters import STAGE, IngestParameters, check
from scenewright.stages.kit.configuration import parameters_for


def ingest_parameters(pairs: Iterable[str]) -> IngestParameters:
    """Return the parameters that `name=value` words ask for. Raises UsageError for unknown names and values."""
    values: dict[str, Any] = {}
    for pair in pairs:
        name, separator, value = pair.partition("=")
        name = name.strip().lstrip("-").replace("-", "_")
        if not separator or not name:
            raise UsageError(f"--set {pair!r}: not name=value", hint="for example --set depth_scale=5000")
        field = IngestParameters.model_fields.get(name)
        if field is not None and get_origin(field.annotation) is tuple:
            values[name] = (*values.get(name, ()), value)
        else:
            values[name] = value
    parameters = parameters_for(STAGE, {}, values, "--set")
    assert isinstance(parameters, IngestParameters)
    check(parameters, {})
    return parameters

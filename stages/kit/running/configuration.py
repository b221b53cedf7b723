"""Parameters from flags and a config file. Flags win; unknown keys and values out of range are usage errors."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from schemas.errors import UsageError
from stages.kit.stage import Parameters, Stage


def read_config(path: Path) -> dict[str, Any]:
    """Read a TOML file. Raises UsageError when it is missing or malformed."""
    try:
        with Path(path).open("rb") as file:
            return tomllib.load(file)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}", hint="give a TOML file to --config") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: {error}", hint="a config file is TOML: name = value") from None


def parameters_for(
    stage: Stage, flags: Mapping[str, Any], config: Mapping[str, Any] | None = None, config_name: str = "config"
) -> Parameters:
    """Build the parameters of a step. Raises UsageError naming the option and the allowed range."""
    values = dict(config or {})
    unknown = sorted(set(values) - set(stage.parameters.model_fields))
    if unknown:
        known = ", ".join(stage.parameters.model_fields)
        raise UsageError(f"{config_name}: step {stage.name!r} has no parameter {unknown[0]!r}", hint=f"it has: {known}")
    values.update({name: value for name, value in flags.items() if value is not None})
    try:
        return stage.parameters(**values)
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0]) if first["loc"] else "parameters"
        option = "--" + name.replace("_", "-")
        raise UsageError(f"{stage.name}: {option}: {first['msg']}", hint=f"got {first.get('input')!r}") from None

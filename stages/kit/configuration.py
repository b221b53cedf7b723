"""Parameters from flags and a config file. Flags win; unknown keys and values out of range are usage errors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol, TypeVar

from pydantic import ValidationError
from scenewright.schemas.errors import UsageError
from scenewright.schemas.outside import file_toml
from scenewright.stages.kit.stage import NOT_SHOWN, Parameters

Kind = TypeVar("Kind", bound=Parameters, covariant=True)

LARGEST_TOML = 16 * 2**20
"""Largest configuration file [bytes]."""


def read_config(path: Path) -> dict[str, Any]:
    """Read a TOML file. Raises UsageError when it is missing or malformed."""
    return read_toml(path, hint="a config file is TOML: name = value")


def read_toml(path: Path, *, hint: str) -> dict[str, Any]:
    """Return what a TOML file says. Raises UsageError, with `hint`, when it is missing, malformed or too large."""
    return file_toml(path, LARGEST_TOML, error=UsageError, hint=hint)


class WithParameters(Protocol[Kind]):
    """A step or a training."""

    @property
    def name(self) -> str:
        """Its command."""
        ...

    @property
    def parameters(self) -> type[Kind]:
        """The kind of its options."""
        ...


def parameters_for(
    stage: WithParameters[Kind],
    flags: Mapping[str, Any],
    config: Mapping[str, Any] | None = None,
    config_name: str = "config",
) -> Kind:
    """Build the parameters of a step or a training. Raises UsageError naming the option and the allowed range."""
    values = dict(config or {})
    unknown = sorted(set(values) - set(stage.parameters.model_fields))
    if unknown:
        names = ", ".join(stage.parameters.model_fields)
        raise UsageError(f"{config_name}: step {stage.name!r} has no parameter {unknown[0]!r}", hint=f"it has: {names}")
    values.update({name: value for name, value in flags.items() if value is not None})
    try:
        return stage.parameters(**values)
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0]) if first["loc"] else "parameters"
        option = "--" + name.replace("_", "-")
        # A value that may be a password, given for the name of one, is not said back.
        got = "" if first["type"] == NOT_SHOWN else f"got {first.get('input')!r}"
        wrong = [problem["msg"] for problem in error.errors() if problem["loc"][:1] == first["loc"][:1]]
        raise UsageError(f"{stage.name}: {option}: {', or: '.join(wrong)}", hint=got) from None

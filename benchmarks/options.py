"""Command lines out of parameters: of experiments, and of recipes, which have no others."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Literal, TypeVar, Union, get_args, get_origin

from pydantic import Field, ValidationError
from pydantic.fields import FieldInfo
from scenewright.stages.kit.stage import Parameters

Asked = TypeVar("Asked", bound=Parameters)


class Recipe(Parameters):
    """Options of every recipe."""

    out: Path = Field(description="Output folder")
    quick: bool = Field(False, description="Proves the recipe: little data, few steps")


def asked(kind: type[Asked]) -> Asked:
    """Return what the command line asks of the module that was started, whose docstring is the help. Raises
    SystemExit(2) for a value out of range."""
    module = sys.modules["__main__"]
    name = module.__spec__.name.removesuffix(".__main__") if module.__spec__ else ""
    parser = argparse.ArgumentParser(
        prog=f"python -m {name}", description=module.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for each, field in kind.model_fields.items():
        add_option(parser, each, field)
    given = {each: value for each, value in vars(parser.parse_args()).items() if value is not None}
    try:
        return kind.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        parser.error(f"--{str(first['loc'][0]).replace('_', '-')}: {first['msg']}")


def add_option(parser: argparse.ArgumentParser, name: str, field: FieldInfo) -> None:
    """Add the option of a parameter."""
    kind = field.annotation
    if get_origin(kind) is Union or type(kind).__name__ == "UnionType":
        kind = next(each for each in get_args(kind) if each is not type(None))
    option = f"--{name.replace('_', '-')}"
    told = "" if field.is_required() else f" (default: {field.default})"
    text = f"{field.description}{told}".replace("%", "%%")
    if kind is bool:
        parser.add_argument(option, action=argparse.BooleanOptionalAction, default=None, help=text)
    elif get_origin(kind) is Literal:
        parser.add_argument(option, choices=get_args(kind), help=text)
    elif get_origin(kind) is tuple:
        parser.add_argument(option, nargs="*", type=get_args(kind)[0], help=text)
    else:
        parser.add_argument(option, type=kind, required=field.is_required(), help=text)  # type: ignore[arg-type]

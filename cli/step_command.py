"""The command of a step, generated from its declaration: options, help, ranges and errors are said once, there."""

from __future__ import annotations

import inspect
import json
import sys
from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Optional, Union, get_args, get_origin

import typer
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from scenewright.cli.output import out, say, say_error
from scenewright.schemas.base import LARGEST_SEED
from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.chain import OUTCOME_EXIT_CODE
from scenewright.stages.engine.memory_limit import parse_limit
from scenewright.stages.engine.runner import RunResult, run_stage
from scenewright.stages.kit.configuration import parameters_for, read_config
from scenewright.stages.kit.progress import progress_for
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

_BOUNDS = (("ge", "at least"), ("gt", "above"), ("le", "at most"), ("lt", "below"))


def _bare_type(annotation: Any) -> Any:
    """Strip None from a union."""
    if get_origin(annotation) in (Union, UnionType):
        others = [item for item in get_args(annotation) if item is not NoneType]
        return others[0] if len(others) == 1 else str
    return annotation


def _option_type(annotation: Any) -> tuple[Any, str]:
    """Return the typer type of a parameter and what to add to its help."""
    bare = _bare_type(annotation)
    if get_origin(bare) is Literal:
        return Optional[str], "one of " + ", ".join(map(str, get_args(bare)))  # noqa: UP045
    if get_origin(bare) is tuple:
        return Optional[list[get_args(bare)[0]]], "may be repeated"  # type: ignore[misc]  # noqa: UP045
    if inspect.isclass(bare) and issubclass(bare, Enum):
        return Optional[str], "one of " + ", ".join(str(item.value) for item in bare)  # noqa: UP045
    return Optional[bare], ""  # noqa: UP045


def _default_text(field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    if default is PydanticUndefined:
        return "required"
    if default is None:
        return "none"
    if isinstance(default, Enum):
        return str(default.value)
    if isinstance(default, tuple):
        return " ".join(map(str, default)) or "none"
    return str(default).lower() if isinstance(default, bool) else str(default)


def _help_of(field: FieldInfo, extra: str) -> str:
    bounds = [
        f"{word} {getattr(item, name)}"
        for item in field.metadata
        for name, word in _BOUNDS
        if getattr(item, name, None) is not None
    ]
    notes = [text for text in (extra, " and ".join(bounds), f"default: {_default_text(field)}") if text]
    return f"{field.description} [{'; '.join(notes)}]"


def _parameter(name: str, annotation: Any, option: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=option, annotation=annotation)


def _input_options(stage: Stage) -> list[inspect.Parameter]:
    options = []
    for role, declared in stage.reads.items():
        optional = isinstance(declared, Optionally)
        kind = declared.what if isinstance(declared, Optionally) else declared
        text = kind.description if isinstance(kind, External) else f"Artifact {kind.kind}: {kind.description}"
        if not isinstance(kind, External) and kind.outside:
            text += f"; or a file like {kind.outside} of one's own"
        flag = "--" + role.replace("_", "-")
        optional = optional or role == stage.argument
        annotation = Optional[Path] if optional else Path  # noqa: UP045
        default = None if optional else ...
        if role == stage.argument:
            argument = typer.Argument(None, metavar=role.upper(), help=text, show_default=False)
            options.append(_parameter("argument", annotation, argument))
        options.append(
            _parameter(f"input_{role}", annotation, typer.Option(default, flag, help=text, rich_help_panel="Inputs"))
        )
    return options


def parameter_options(parameters: type[Parameters]) -> list[inspect.Parameter]:
    """Return the options that typer reads, named `parameter_<name>`: None where one is not given."""
    options = []
    for name, field in parameters.model_fields.items():
        annotation, extra = _option_type(field.annotation)
        flag = "--" + name.replace("_", "-")
        flags = [f"{flag}/--no-{flag[2:]}"] if _bare_type(field.annotation) is bool else [flag]
        option = typer.Option(None, *flags, help=_help_of(field, extra), show_default=False)
        options.append(_parameter(f"parameter_{name}", annotation, option))
    return options


def _common_options(stage: Stage) -> list[inspect.Parameter]:
    panel: dict[str, Any] = {"rich_help_panel": "Running", "show_default": False}

    def flag(name: str, text: str) -> inspect.Parameter:
        return _parameter(name, bool, typer.Option(False, f"--{name.replace('_', '-')}", help=text, **panel))

    out = f"Folder of the {stage.writes.kind} artifact to write."
    seed = "Seed of all randomness [default: 0]."
    return [
        _parameter("out", Path, typer.Option(..., "--out", help=out, **panel)),
        _parameter("seed", int, typer.Option(0, "--seed", min=0, max=LARGEST_SEED, help=seed, **panel)),
        _parameter("device", str, typer.Option("cpu", "--device", help="auto, cpu or cuda [default: cpu].", **panel)),
        _parameter(
            "config",
            Optional[Path],  # noqa: UP045
            typer.Option(None, "--config", help="TOML file of parameters; flags win.", **panel),
        ),
        _parameter(
            "max_memory",
            Optional[str],  # noqa: UP045
            typer.Option(None, "--max-memory", help="Stop with exit code 6 when the step uses more: 4GiB.", **panel),
        ),
        *([] if stage.required() else [_shared_option(panel)]),
        flag("force", "Make it again even when it is up to date."),
        flag("dry_run", "Say what would run and why; write nothing."),
        _parameter(
            "accept",
            Optional[list[str]],  # noqa: UP045
            typer.Option(None, "--accept", help="Outcome besides ok that exits with 0; may be repeated.", **panel),
        ),
        _parameter(
            "json_output", bool, typer.Option(False, "--json", help="One JSON object on standard output.", **panel)
        ),
        flag("quiet", "No progress: the result and warnings only."),
        flag("debug", "Show the traceback of an error."),
    ]


def _shared_option(panel: dict[str, Any]) -> inspect.Parameter:
    text = "Folder in which runs share it: taken from there when the same was made before, kept there when made."
    return _parameter("shared", Optional[Path], typer.Option(None, "--shared", help=text, **panel))  # noqa: UP045


def report_result(result: RunResult, stage: Stage, accept: tuple[str, ...], json_output: bool) -> int:
    """Print what came of a run (standard output: the path, or JSON) and return the exit code."""
    manifest = result.manifest
    if json_output:
        facts = {
            "stage": stage.name,
            "kind": stage.writes.kind,
            "status": result.status,
            "reason": result.reason,
            "path": str(result.path),
            "key": result.key,
            "content_digest": manifest.content_digest if manifest else None,
            "outcome": result.outcome,
            "summary": manifest.summary if manifest else {},
            "nondeterministic": result.nondeterministic,
            "estimate": result.estimate.as_json() if result.estimate else None,
        }
        out(json.dumps(facts, sort_keys=True))
    else:
        if manifest is not None:
            summary = ", ".join(f"{name} {value}" for name, value in manifest.summary.items())
            seconds = f" in {manifest.provenance.seconds:.1f} s" if result.status == "made" else ""
            why = f" ({result.reason})" if result.status == "taken" else ""
            say(f"{stage.name}: {result.status}{seconds}{why}: {result.outcome}. {summary}")
        else:
            expected = f"; {result.estimate}" if result.estimate else ""
            say(f"{stage.name}: {result.status}: {result.reason}{expected}")
        out(str(result.path))
    if manifest is not None and manifest.outcome != "ok" and manifest.outcome not in accept:
        say_error(
            f"{stage.name}: outcome is {manifest.outcome!r}: "
            f"{manifest.summary.get('reason', 'see the summary')} (--accept {manifest.outcome} goes on)"
        )
        return OUTCOME_EXIT_CODE
    return 0


def given_flags(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters that the command line gave, by name."""
    flags = {name.removeprefix("parameter_"): value for name, value in options.items() if name.startswith("parameter_")}
    return {name: value for name, value in flags.items() if value not in (None, [])}


def make_command(stage: Stage) -> Callable[..., int]:
    """Return a function with the signature that typer reads for this step."""

    def command(**options: Any) -> int:
        config = read_config(options["config"]) if options["config"] else {}
        parameters = parameters_for(stage, given_flags(options), config, str(options["config"]))
        if options.get("argument") is not None:
            if options[f"input_{stage.argument}"] is not None:
                raise UsageError(f"{stage.name}: {stage.argument} is given twice", hint="give it once")
            options[f"input_{stage.argument}"] = options["argument"]
        inputs = {role: path for role in stage.reads if (path := options[f"input_{role}"]) is not None}
        result = run_stage(
            stage,
            inputs,
            options["out"],
            parameters,
            seed=options["seed"],
            device=options["device"],
            force=options["force"],
            dry_run=options["dry_run"],
            progress=progress_for(sys.stderr.isatty(), quiet=options["quiet"], name=options["out"].name),
            command=("scenewright", *sys.argv[1:]),
            max_memory=parse_limit(options["max_memory"]) if options["max_memory"] is not None else None,
            shared=options.get("shared"),
        )
        return report_result(result, stage, tuple(options["accept"] or ()), options["json_output"])

    parameters = [*_input_options(stage), *parameter_options(stage.parameters), *_common_options(stage)]
    text = f"{stage.summary}\n\nExample: {stage.example}" if stage.example else stage.summary
    return named(command, stage.name, text, parameters)


def named(command: Callable[..., int], name: str, text: str, parameters: list[inspect.Parameter]) -> Callable[..., int]:
    """Give a function the name, the help and the signature that typer reads, and return it."""
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    command.__name__, command.__doc__ = name.replace(" ", "_"), text
    return command

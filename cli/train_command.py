"""`scenewright train NAME`: the trainings that the steps declare; alone it lists them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer
from scenewright.cli.output import out
from scenewright.cli.step_command import given_flags, named, parameter_options
from scenewright.stages.engine.discovery import all_trainings
from scenewright.stages.kit.configuration import parameters_for
from scenewright.stages.kit.training.declaration import TrainingDeclaration


def training_group() -> typer.Typer:
    """Return the group of commands, one for each declared training; no training's code is loaded."""
    group = typer.Typer(invoke_without_command=True, rich_markup_mode=None)
    group.callback(help="Train what a step comes with, or fit its constants; alone: list what there is.")(_list)
    for name, training in all_trainings().items():
        group.command(name=name, help=training.summary)(_command(training))
    return group


def _list(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        width = max(map(len, all_trainings()))
        for name, training in all_trainings().items():
            out(f"{name:{width}}  {training.summary}")


def _command(training: TrainingDeclaration) -> Callable[..., int]:
    def command(**options: Any) -> int:
        training.run(parameters_for(training, given_flags(options)), options["out"])
        out(str(options["out"]))
        return 0

    keyword = inspect.Parameter.KEYWORD_ONLY
    folder = typer.Option(..., "--out", help="Folder to write into; a training that was stopped goes on from there.")
    debug = typer.Option(False, "--debug", help="Show the traceback of an error.")
    parameters = [
        *parameter_options(training.parameters),
        inspect.Parameter("out", keyword, default=folder, annotation=Path),
        inspect.Parameter("debug", keyword, default=debug, annotation=bool),
    ]
    return named(command, training.name, training.summary, parameters)

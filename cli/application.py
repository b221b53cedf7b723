"""The command table: one command per declared step, found by folder, and the housekeeping commands."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import typer
from scenewright.cli import housekeeping
from scenewright.cli.step_command import make_command
from scenewright.cli.train_command import training_group
from scenewright.stages.engine.discovery import all_stages, package_of

logger = logging.getLogger("scenewright")
HELP = """Turn robot logs into scenes a robot can act in, and act in them.

Each step reads artifact folders and writes one; `scenewright run reconstruct` chains them.
Standard output carries data only; exit codes: 0 done, 2 usage, 3 bad input, 4 outcome not ok,
5 something is missing, 6 the machine failed, 130 interrupted."""


def build_application() -> Callable[..., Any]:
    """Build the command line from the declarations of the steps; no step's code is loaded."""
    application = typer.Typer(
        help=HELP, no_args_is_help=True, add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False
    )
    groups: dict[str, typer.Typer] = {}
    two_words = {("urdf", "check"), ("urdf", "settle"), ("urdf", "protocol")}
    ours = {function.__name__ for function, _ in housekeeping.COMMANDS} | {
        name for name, *_ in (*housekeeping.GROUPS, *housekeeping.ALONE)
    }
    for name, stage in all_stages().items():
        if stage.folder.replace("-", "_") in ours:
            logger.warning("%s: its step %r is left out: there is a command %s", package_of(stage), name, stage.folder)
            continue
        group, _, command = name.rpartition(" ")
        parent = application
        if group in all_stages():
            two_words.add((group, command))
            command = f"{group}-{command}"
        elif group:
            if group not in groups:
                groups[group] = typer.Typer(help=f"Commands of {group}.", no_args_is_help=True, rich_markup_mode=None)
                application.add_typer(groups[group], name=group)
            parent = groups[group]
        parent.command(name=command, help=stage.summary, rich_help_panel="Steps")(make_command(stage))
    for group, function in housekeeping.BESIDE_STEPS:
        if group in groups:
            groups[group].command()(function)
    for function, help_panel in housekeeping.COMMANDS:
        application.command(rich_help_panel=help_panel)(function)
    for name, alone, below, help_panel in housekeeping.GROUPS:
        group_application = typer.Typer(invoke_without_command=True, rich_markup_mode=None)
        group_application.callback()(alone)
        for function in below:
            group_application.command()(function)
        application.add_typer(group_application, name=name, rich_help_panel=help_panel)
    for name, says, below, help_panel in housekeeping.ALONE:
        group_application = typer.Typer(help=f"{says}.", no_args_is_help=True, rich_markup_mode=None)
        for function in below:
            group_application.command()(function)
        application.add_typer(group_application, name=name, rich_help_panel=help_panel)
    application.add_typer(training_group(), name="train", rich_help_panel="Training")
    application.callback()(housekeeping.root)
    table = typer.main.get_command(application)

    def entry(args: list[str], **settings: Any) -> Any:
        """`urdf` and `export` are steps by themselves, so that `urdf check` or `export scene` can't be in a group."""
        if tuple(args[:2]) in two_words:
            args = [f"{args[0]}-{args[1]}", *args[2:]]
        return table(args=args, **settings)

    return entry

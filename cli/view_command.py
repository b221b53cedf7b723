"""`scenewright view`: an artifact in a browser, in Rerun, or as a file; and a map put right by clicking."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli.output import out
from scenewright.schemas.errors import UsageError


def view(
    path: Annotated[Path, typer.Argument(help="Artifact folder of any kind.")],
    save: Annotated[Path | None, typer.Option("--save", help="Write an .html page, or an .rrd file.")] = None,
    edit: Annotated[
        Path | None, typer.Option("--edit", help="edits.toml that the page writes to; it is made where there is none.")
    ] = None,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="With --edit: show what the edits come to, and write nothing.")
    ] = False,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port to serve on; 0 takes a free one.")] = 0,
    rerun: Annotated[bool, typer.Option("--rerun", help="Open it in Rerun (an extra: pip install rerun-sdk).")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show every request, and the traceback of an error.")] = False,
) -> int:
    """Show an artifact in a browser, on this machine alone, until it is interrupted; prints the page's address.

    With --edit the page writes down what you put right, as `scenewright edit rename` and the like do.
    """
    serves = save is None and not rerun
    if save is not None and rerun:
        raise UsageError("--save and --rerun are two ways to look", hint="choose one")
    if not serves and (edit is not None or read_only or port):
        raise UsageError(
            "--edit, --read-only and --port are for a page that is served", hint="leave --save and --rerun out"
        )
    if not serves:
        from scenewright.cli.viewing.view import view_artifact

        view_artifact(path, save)
        if save is not None:
            out(str(save))
        return 0
    if read_only and edit is None:
        raise UsageError("--read-only needs --edit", hint="without --edit nothing is written anyway")
    if edit is not None and not edit.parent.is_dir():
        raise UsageError(f"{edit.parent}: no folder", hint="make it, or choose another place for the edits")
    from scenewright.cli.viewing.desk.desk import Desk
    from scenewright.cli.viewing.desk.server import DeskServer

    with DeskServer(Desk(path, edit, read_only=read_only), port) as server:
        edits_note = f"; what you put right is kept in {edit}" if edit is not None and not read_only else ""
        sys.stderr.write(f"open this address in a browser{edits_note}; Ctrl-C ends it\n")
        sys.stdout.write(server.page_address + "\n")
        sys.stdout.flush()
        server.serve_forever(poll_interval=0.2)
    return 0

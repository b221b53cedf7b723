"""`scenewright cutting record`: a page on which a person cuts."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def record(
    file: Annotated[Path, typer.Argument(help="The recording; one that is there is gone on with.")],
    food: Annotated[str, typer.Option("--food", help="What is cut: bread, carrot, cheese, cucumber, ...")] = "carrot",
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**31 - 1, help="Of the first food.")] = 0,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port to listen on; 0 takes a free one.")] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", help="Warnings only.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show every request, and the traceback of an error.")] = False,
) -> int:
    """Cut by clicking on pictures in a browser, on this machine alone; `cutting demonstrate --record FILE` follows.

    Prints the page's address. The file is written after every cut.
    """
    from scenewright.schemas.errors import BadInput
    from scenewright.stages.cutting.recording.server import RecordingServer
    from scenewright.stages.cutting.recording.session import Session

    if not file.parent.is_dir():
        raise BadInput(f"{file.parent}: no folder", hint="make it, or choose another place for the recording")
    with RecordingServer(Session(file, food, seed), port) as server:
        sys.stderr.write(f"open this address in a browser; every cut is kept in {file}; Ctrl-C ends it\n")
        sys.stdout.write(server.page_address + "\n")
        sys.stdout.flush()
        server.serve_forever(poll_interval=0.2)
    sys.stderr.write(f"next: scenewright cutting demonstrate --record {file} --out ...\n")
    return 0

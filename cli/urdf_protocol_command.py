"""`scenewright urdf protocol`: does a scene of whatever origin hold, by rules that others can repeat?"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli.output import out as say

JSON_NAME, PICTURE_NAME = "protocol.json", "protocol.png"


def urdf_protocol(
    scene: Annotated[
        Path,
        typer.Argument(help="Folder of an interactive scene, `room/` of a ground truth, or a URDF, MJCF or SDF file."),
    ],
    root: Annotated[
        Path | None,
        typer.Option("--root", help="Folder that the meshes of a URDF or SDF lie in. [default: that of the file]"),
    ] = None,
    seen: Annotated[
        int | None, typer.Option("--seen", min=1, help="Things that were seen. [default: those of its contact graph]")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder to write protocol.json and protocol.png into.")
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Judge a scene by the protocol of docs/FORMATS.md: let go for 5 s in MuJoCo and Bullet, pairs of bodies in each
    other, joints swept, and what was kept of what was seen. Nothing that a file says is executed. Exits with 4 when a
    free body is not stable, lies in another, or a joint is blocked where it begins, or when nothing can move.
    """
    from scenewright.stages.engine.chain import OUTCOME_EXIT_CODE
    from scenewright.stages.library.importing.scenes.opening import opened_scene
    from scenewright.stages.urdf.protocol import protocol
    from scenewright.stages.urdf.protocol_text import as_json, table

    if out is not None:
        _check_out(out)
    with opened_scene(scene, root) as opened:
        found = protocol(opened.folder, model=opened.model, numbers=opened.numbers, seen=seen)
        document = as_json(found, str(scene), opened.format, opened.findings)
        if out is not None:
            _write(out, opened.folder, document)
    if json_output:
        say(json.dumps(document))
    else:
        for line in table(document):
            say(line)
    return 0 if found.sound else OUTCOME_EXIT_CODE


def _check_out(folder: Path) -> None:
    """Raise UsageError where something else than an earlier protocol stands."""
    from scenewright.schemas.errors import UsageError

    hint = "choose another --out"
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"--out {folder}: a file of this name stands there", hint=hint)
    inside = sorted(path.name for path in folder.iterdir()) if folder.exists() else []
    others = [name for name in inside if name not in (JSON_NAME, PICTURE_NAME)]
    if others:
        raise UsageError(f"--out {folder}: it holds {others[0]:.60}, which is not a protocol", hint=hint)


def _write(out: Path, folder: Path, document: dict[str, object]) -> None:
    """Write the JSON and the picture, whole or not at all."""
    from scenewright.stages.engine import store
    from scenewright.stages.urdf.protocol_picture import draw_protocol

    with store.locked(out), store.partial_folder(out) as partial:
        (partial / JSON_NAME).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        draw_protocol(partial / PICTURE_NAME, folder, document)
        store.take_place(partial, out)

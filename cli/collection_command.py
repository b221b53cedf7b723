"""`scenewright gc`: what can go, how much it frees, and with --delete its going."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated, Any

import typer
from scenewright.cli.output import out


def gc(
    runs: Annotated[
        list[Path] | None, typer.Argument(help="Run folders, or folders of runs [default: outputs].")
    ] = None,
    delete: Annotated[bool, typer.Option("--delete", help="Delete it; without this, it is only listed.")] = False,
    superseded: Annotated[
        bool, typer.Option("--superseded", help="Artifacts too whose inputs were made again with another result.")
    ] = False,
    intermediate: Annotated[
        bool,
        typer.Option("--intermediate", help="Artifacts too that others were made from and that can be made again."),
    ] = False,
    keep: Annotated[
        list[str] | None, typer.Option("--keep", help="Kind of artifact that stays; may be repeated.")
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say what can go and how much that frees: leftovers of killed runs, superseded and intermediate artifacts."""
    from scenewright.stages.engine.collection import collect, survey

    items = survey(runs or [Path("outputs")], superseded=superseded, intermediate=intermediate, keep=keep or ())
    gone, stayed = collect(items) if delete else ([], [])
    if json_output:
        document = {
            "deleted": delete,
            "freed_bytes": sum(item.bytes for item in gone),
            "collectable_bytes": sum(item.bytes for item in items if item.collectable),
            "items": [{**vars(item), "path": str(item.path)} for item in items],
            "failed": [{**vars(item), "path": str(item.path)} for item in stayed],
        }
        out(json.dumps(document, sort_keys=True))
    else:
        out("\n".join(_lines(items, gone, stayed, delete)))
    return 6 if stayed else 0


def _lines(items: list[Any], gone: list[Any], stayed: list[Any], delete: bool) -> list[str]:
    lines = []
    for item in items:
        mark = "goes" if item.collectable else "stays"
        path = os.path.relpath(item.path)
        lines.append(f"{mark:5} {item.category:12} {item.bytes / 1e6:9.1f} MB  {path}  ({item.reason})")
    if delete:
        lines.append(f"freed {sum(item.bytes for item in gone) / 1e6:.1f} MB in {len(gone)} places")
        lines += [f"stayed: {os.path.relpath(item.path)}: {item.reason}" for item in stayed]
        return lines
    ready = sum(item.bytes for item in items if item.collectable)
    lines.append(f"--delete frees {ready / 1e6:.1f} MB")
    for category in ("superseded", "intermediate"):
        further_bytes = sum(item.bytes for item in items if item.category == category and not item.collectable)
        if further_bytes:
            lines.append(f"--{category} may add up to {further_bytes / 1e6:.1f} MB")
    return lines

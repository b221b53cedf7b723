"""`scenewright explain`: why a thing, joint, body, plane or plan step of an artifact is what it is."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli.output import out, say


def explain(
    path: Annotated[Path, typer.Argument(help="Map, contact graph, CAD scene, interactive scene or plan.")],
    name: Annotated[str | None, typer.Argument(help="What is asked for; without it, the names are listed.")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say why a thing, joint, plane or plan step is what it is, from the artifact and what it was made from."""
    from scenewright.cli.explaining.explaining import explain as explain_artifact
    from scenewright.stages.engine.reading import open_artifact

    explained = explain_artifact(open_artifact(path))
    head = {"artifact": str(path), "kind": explained.artifact.kind, "left_out": list(explained.missing)}
    if name is None:
        names = explained.names()
        out(json.dumps(head | {"names": names}, sort_keys=True) if json_output else "\n".join(names))
        return 0
    found = explained.of(name)
    if json_output:
        rows = [
            {
                "kind": artifact.kind,
                "artifact": os.path.normpath(artifact.root),
                "says": reason.says,
                "facts": dict(reason.facts),
            }
            for artifact, reasons in found
            for reason in reasons
        ]
        out(json.dumps(head | {"name": name, "reasons": rows}, sort_keys=True))
    else:
        for artifact, reasons in found:
            out(f"{artifact.kind} {os.path.normpath(artifact.root)}")
            for reason in reasons:
                out(f"  {reason.says}")
    for line in explained.missing:
        say(line)
    return 0

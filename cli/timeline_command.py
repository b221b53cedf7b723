"""`scenewright timeline`: how a contact graph grew while the map did."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli.output import out


def timeline(
    folder: Annotated[Path, typer.Argument(help="contact_graph artifact of a map with snapshots.")],
    json_output: Annotated[bool, typer.Option("--json", help="The whole timeline as one JSON object.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say what appeared, went, was renamed and was attached elsewhere while mapping went on, a line for each change."""
    from scenewright.schemas.contact_graph import ContactGraph, GraphSnapshot
    from scenewright.schemas.errors import BadInput
    from scenewright.stages.engine.reading import open_artifact

    artifact = open_artifact(folder, ContactGraph)
    grown = artifact.timeline if isinstance(artifact, ContactGraph) else None
    if grown is None:
        raise BadInput(
            f"{folder}: the map of this graph kept no snapshots",
            hint="run `scenewright fuse` with --snapshot-every N, then `scenewright graph`; N: at most its frames",
        )
    if json_output:
        out(grown.model_dump_json())
        return 0

    def lines_of(snapshot: GraphSnapshot) -> list[str]:
        changes = snapshot.changes
        return [
            *(f"+ {name}" for name in changes.appeared),
            *(f"- {name}" for name in changes.vanished),
            *(f"- {name}, now part of {merged_step}" for name, merged_step in changes.merged.items()),
            *(f"~ {name} was taken for {before}" for name, before in changes.renamed.items()),
            *(
                f"~ {c.node}: {c.parent} {c.relation} it, before {c.before_parent} {c.before_relation}"
                for c in changes.reattached
            ),
            *(f"+ {c.source} {c.relation} {c.target}" for c in changes.added),
            *(f"- {c.source} {c.relation} {c.target}" for c in changes.removed),
        ]

    for snapshot in grown.snapshots:
        out(f"{snapshot.frames} frames: {len(snapshot.nodes) - 1} nodes, {len(snapshot.links)} links")
        for line in lines_of(snapshot):
            out(f"  {line}")
    return 0

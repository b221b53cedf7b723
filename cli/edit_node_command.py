"""`scenewright edit support | mark`: a line more in edits.toml about a node of a graph, which `edit graph` applies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from cli.edit_command import By, Debug, File, Note, append
from schemas.errors import UsageError

if TYPE_CHECKING:
    from stages.edit.map_state import Thing

NodeName = Annotated[str, typer.Argument(help="A thing of the graph: its node's name (cup_7), or its instance number.")]
Graph = Annotated[Path, typer.Option("--contact-graph", help="The graph as it was built, edited or not.")]
How = Literal["supports", "contains", "carries_on_wall", "hangs_from"]
NOTHING = "nothing"


def support(
    file: File,
    thing: NodeName,
    contact_graph: Graph,
    on: Annotated[str, typer.Option("--on", help="What carries it: a thing of the graph, or `nothing`.")],
    relation: Annotated[How, typer.Option("--relation", help="What the carrier does.")] = "supports",
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say what a thing of a graph stands on, in, at or below, or that nothing carries it."""
    values: dict[str, Any] = {"relation": relation} if on != NOTHING else {}
    things = _things(contact_graph)
    if on != NOTHING:
        values["on"] = _anchor(things, on, contact_graph)
    return append(file, by, note, what="support", of=_anchor(things, thing, contact_graph), **values)


def mark(
    file: File,
    thing: NodeName,
    as_: Annotated[Literal["fixed", "movable"], typer.Argument(metavar="fixed|movable", help="What it is.")],
    contact_graph: Graph,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say that a thing of a graph stays where it is, or is free to move, whatever its class says."""
    of = _anchor(_things(contact_graph), thing, contact_graph)
    return append(file, by, note, what="mark", of=of, **{"as": as_})


COMMANDS = (support, mark)


def _things(path: Path) -> list[Thing]:
    from schemas.contact_graph import ContactGraph
    from stages.edit.graph_edits import GraphState
    from stages.engine.reading import open_artifact

    opened = open_artifact(path, ContactGraph)
    assert isinstance(opened, ContactGraph)
    return GraphState(opened.info).things()


def _anchor(things: list[Thing], name: str, path: Path) -> dict[str, Any]:
    """Return the anchor of the node that is called so. Raises UsageError when there is none with a box."""
    from stages.edit.anchoring import anchor_of_node

    found = [thing for thing in things if thing.name == name or thing.name.rpartition("_")[2] == name]
    if len(found) != 1:
        shown = ", ".join(thing.name for thing in things[:12]) + (", ..." if len(things) > 12 else "")
        many = "more than one thing" if found else "no thing"
        raise UsageError(f"{path}: has {many} {name!r:.80}", hint=f"it has: {shown or 'none'}")
    return anchor_of_node(found[0]).model_dump(by_alias=True)

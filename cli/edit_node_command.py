"""`scenewright edit support | mark | model | move | joint | no-joint | new-joint`: a line more in edits.toml, about a
node of a graph or a CAD scene, which `edit graph` or `edit scene` applies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from scenewright.cli.edit_command import By, Center, Debug, File, Note, Size, Yaw, append
from scenewright.schemas.errors import UsageError

if TYPE_CHECKING:
    from scenewright.stages.edit.map_state import Thing
    from scenewright.stages.edit.scene_state import SceneState

NodeName = Annotated[str, typer.Argument(help="A thing of the graph: its node's name (cup_7), or its instance number.")]
Graph = Annotated[Path, typer.Option("--contact-graph", help="The graph as it was built, edited or not.")]
Scene = Annotated[Path, typer.Option("--cad-scene", help="The scene as `cad` made it, edited or not.")]
JointName = Annotated[str, typer.Argument(metavar="JOINT", help="Name of a joint of its model.")]
Triple = tuple[float, float, float]
How = Literal["supports", "contains", "carries_on_wall", "hangs_from"]
NOTHING, NO_MODEL = "nothing", "none"


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
    contact_graph: Annotated[Path | None, typer.Option("--contact-graph", help="The graph, edited or not.")] = None,
    cad_scene: Annotated[Path | None, typer.Option("--cad-scene", help="Or the scene, edited or not.")] = None,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say that a thing of a graph or scene stays where it is, or is free to move, whatever its class says."""
    if (contact_graph is None) == (cad_scene is None):
        raise UsageError("edit mark: give either --contact-graph or --cad-scene", hint="see --help")
    things = _things(contact_graph) if contact_graph is not None else _opened(cad_scene or Path()).things()
    of = _anchor(things, thing, contact_graph or cad_scene or Path())
    return append(file, by, note, what="mark", of=of, **{"as": as_})


def model(
    file: File,
    thing: NodeName,
    chosen: Annotated[str, typer.Argument(metavar="MODEL", help="Id of a model of the library, or `none`.")],
    cad_scene: Scene,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say which CAD model stands for a thing of a scene, or that none does: its own mesh."""
    values = {} if chosen == NO_MODEL else {"model": chosen}
    return append(file, by, note, what="model", of=_anchor(_opened(cad_scene).things(), thing, cad_scene), **values)


def move(
    file: File,
    thing: NodeName,
    cad_scene: Scene,
    to: Annotated[Triple | None, typer.Option("--to", help="Where the middle of its box goes: x y z [m].")] = None,
    by_metres: Annotated[Triple | None, typer.Option("--shift", help="Or how far it goes: x y z [m].")] = None,
    turn: Annotated[float, typer.Option("--turn", help="How far it turns about the vertical [degrees].")] = 0.0,
    carried: Annotated[bool, typer.Option("--carried", help="What it carries goes with it.")] = False,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say where a thing of a scene stands and how it is turned."""
    from scenewright.stages.edit.scene_edits import asked_move

    if to is not None and by_metres is not None:
        raise UsageError("edit move: give --to or --shift, not both", hint="see --help")
    state = _opened(cad_scene)
    of = _anchor(state.things(), thing, cad_scene)
    node = state.graph.nodes[_named(state.things(), thing, cad_scene).instance]
    if by_metres is not None:
        x, y, z = (a + b for a, b in zip(of["box"]["center"], by_metres, strict=True))
        to = (x, y, z)
    return append(file, by, note, what="move", of=of, carried=carried, **asked_move(node, to, turn))


def joint(
    file: File,
    thing: NodeName,
    name: JointName,
    cad_scene: Scene,
    lower: Annotated[float | None, typer.Option("--lower", help="Least value [rad, m].")] = None,
    upper: Annotated[float | None, typer.Option("--upper", help="Largest value [rad, m].")] = None,
    value: Annotated[float | None, typer.Option("--value", help="Where it stands [rad, m].")] = None,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say that a joint of a thing's model is there, and what its range and value are."""
    given = {"lower": lower, "upper": upper, "value": value}
    said = {key: number for key, number in given.items() if number is not None}
    return append(file, by, note, what="joint", **_joint(cad_scene, thing, name), **said)


def no_joint(
    file: File, thing: NodeName, name: JointName, cad_scene: Scene, by: By = "", note: Note = "", debug: Debug = False
) -> int:
    """Say that a joint of a thing's model is not there: its part stays where it is."""
    return append(file, by, note, what="no_joint", **_joint(cad_scene, thing, name))


def new_joint(
    file: File,
    thing: NodeName,
    cad_scene: Scene,
    kind: Annotated[Literal["revolute", "prismatic"], typer.Option("--type", help="Whether it turns or slides.")],
    center: Center,
    size: Size,
    axis: Annotated[Triple, typer.Option("--axis", help="Direction that opening goes by, in the world.")],
    origin: Annotated[Triple, typer.Option("--origin", help="A point of the axis in the world [m].")],
    upper: Annotated[float, typer.Option("--upper", help="How far it opens [rad, m].")],
    yaw: Yaw = 0.0,
    lower: Annotated[float, typer.Option("--lower", help="Least value [rad, m].")] = 0.0,
    handle: Annotated[Triple | None, typer.Option("--handle", help="Where a hand takes hold of it [m].")] = None,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say that what of a thing lies in a box moves: a door, a drawer, that neither model nor mesh has."""
    values: dict[str, Any] = {"part": {"center": center, "size": size, "yaw_degrees": yaw}, "type": kind}
    values |= {"axis": axis, "origin": origin, "lower": lower, "upper": upper}
    values |= {} if handle is None else {"handle": handle}
    of = _anchor(_opened(cad_scene).things(), thing, cad_scene)
    return append(file, by, note, what="new_joint", of=of, **values)


COMMANDS = (support, mark, model, move, joint, no_joint, new_joint)


def _opened(path: Path) -> SceneState:
    from scenewright.schemas.cad_scene import CadScene
    from scenewright.stages.edit.scene_state import SceneState
    from scenewright.stages.engine.reading import open_artifact

    opened = open_artifact(path, CadScene)
    assert isinstance(opened, CadScene)
    return SceneState(opened.graph, {entry.node: entry for entry in opened.info.replacements}, opened)


def _joint(path: Path, thing: str, name: str) -> dict[str, Any]:
    """Return the anchors of a thing and of a joint of its model. Raises UsageError when it has no such joint."""
    from scenewright.stages.edit.anchoring import Conflict
    from scenewright.stages.edit.scene_edits import joint_anchors

    state = _opened(path)
    things = state.things()
    found = _named(things, thing, path)
    try:
        joints = joint_anchors(state, state.graph.nodes[found.instance])
    except Conflict as conflict:
        raise UsageError(f"{path}: {conflict}", hint="`edit new-joint` gives it one") from None
    if name not in joints:
        raise UsageError(
            f"{path}: {found.name} has no joint {name!r:.80}", hint=f"it has: {', '.join(joints) or 'none'}"
        )
    return {"of": _anchor(things, thing, path), "at": joints[name].model_dump()}


def _things(path: Path) -> list[Thing]:
    from scenewright.schemas.contact_graph import ContactGraph
    from scenewright.stages.edit.graph_edits import GraphState
    from scenewright.stages.engine.reading import open_artifact

    opened = open_artifact(path, ContactGraph)
    assert isinstance(opened, ContactGraph)
    return GraphState(opened.info).things()


def _anchor(things: list[Thing], name: str, path: Path) -> dict[str, Any]:
    """Return the anchor of the node that is called so. Raises UsageError when there is none with a box."""
    from scenewright.stages.edit.anchoring import anchor_of_node

    return anchor_of_node(_named(things, name, path)).model_dump(by_alias=True)


def _named(things: list[Thing], name: str, path: Path) -> Thing:
    found = [thing for thing in things if thing.name == name or thing.name.rpartition("_")[2] == name]
    if len(found) != 1:
        shown = ", ".join(thing.name for thing in things[:12]) + (", ..." if len(things) > 12 else "")
        many = "more than one thing" if found else "no thing"
        raise UsageError(f"{path}: has {many} {name!r:.80}", hint=f"it has: {shown or 'none'}")
    return found[0]

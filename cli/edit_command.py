"""`scenewright edit rename | delete | merge | split | add | gravity | floor`: a line more in edits.toml, which
`edit map` applies."""

from __future__ import annotations

import getpass
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from scenewright.cli.output import out, say
from scenewright.schemas.errors import UsageError
from scenewright.schemas.plain_text import cleaned

if TYPE_CHECKING:
    from scenewright.schemas.edits import AnyEdit
    from scenewright.stages.edit.map_state import MapState

File = Annotated[Path, typer.Argument(help="edits.toml; it is made where there is none.")]
ThingName = Annotated[str, typer.Argument(help="A thing of the map: its instance number, or its node's name (cup_7).")]
Things = Annotated[list[str], typer.Argument(help="Things of the map; the first gives its class.")]
Map = Annotated[Path, typer.Option("--panoptic-map", help="The map as it was seen, edited or not.")]
ClassName = Annotated[str, typer.Option("--class", help="A class of data/vocabulary.toml.")]
Center = Annotated[tuple[float, float, float], typer.Option("--center", help="Of a box: x y z in the world [m].")]
Size = Annotated[tuple[float, float, float], typer.Option("--size", help="Of a box: its edges, the last one up [m].")]
Yaw = Annotated[float, typer.Option("--yaw", help="Of a box: its turn about the vertical [degrees].")]
By = Annotated[str, typer.Option("--by", help="Who edits [default: the name of your account].")]
Note = Annotated[str, typer.Option("--note", help="Why.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def rename(
    file: File,
    thing: ThingName,
    panoptic_map: Map,
    class_name: ClassName,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say that a thing of a map is of another class."""
    return append(file, by, note, what="rename", of=_anchors(panoptic_map, [thing])[0], **{"class": class_name})


def delete(file: File, thing: ThingName, panoptic_map: Map, by: By = "", note: Note = "", debug: Debug = False) -> int:
    """Say that there is no such thing; its surface stays in the map, without a name."""
    return append(file, by, note, what="delete", of=_anchors(panoptic_map, [thing])[0])


def merge(file: File, things: Things, panoptic_map: Map, by: By = "", note: Note = "", debug: Debug = False) -> int:
    """Say that several things of a map are one."""
    if len(set(things)) < 2:
        raise UsageError("merge takes at least two things", hint="give their instance numbers or names")
    return append(file, by, note, what="merge", of=_anchors(panoptic_map, things))


def split(
    file: File,
    thing: ThingName,
    panoptic_map: Map,
    class_name: ClassName,
    center: Center,
    size: Size,
    yaw: Yaw = 0.0,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say that what of a thing lies in a box is a thing of its own."""
    part = {"center": center, "size": size, "yaw_degrees": yaw}
    of = _anchors(panoptic_map, [thing])[0]
    return append(file, by, note, what="split", of=of, part=part, **{"class": class_name})


def add(
    file: File,
    class_name: ClassName,
    center: Center,
    size: Size,
    yaw: Yaw = 0.0,
    drawn: Annotated[
        bool, typer.Option("--drawn", help="No camera saw it (glass): the box itself is its surface.")
    ] = False,
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say that there is a thing in a box that the map does not name."""
    box = {"center": center, "size": size, "yaw_degrees": yaw}
    surface = "box" if drawn else "seen"
    return append(file, by, note, what="add", box=box, surface=surface, **{"class": class_name})


Place = tuple[float, float, float]


def gravity(
    file: File,
    first: Annotated[Place, typer.Option("--first", help="A place x y z [m] of a surface that is level in truth.")],
    second: Annotated[Place, typer.Option("--second", help="Another one.")],
    third: Annotated[Place, typer.Option("--third", help="Another one, not on a line with them.")],
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say what is level: the map is turned until it is."""
    return append(file, by, note, what="gravity", level=(first, second, third))


def floor(
    file: File,
    at: Annotated[Place, typer.Option("--at", help="A place on the floor: x y z [m].")],
    by: By = "",
    note: Note = "",
    debug: Debug = False,
) -> int:
    """Say where the floor is: level, at this height, below the whole map."""
    return append(file, by, note, what="floor", at=at)


GRAPH, SCENE = "graph --contact-graph", "scene --cad-scene"
APPLIED_BY = {
    "support": GRAPH,
    "mark": "graph|scene",
    **dict.fromkeys(("model", "move", "joint", "no_joint", "new_joint"), SCENE),
}
"""What applies an edit that is none of a map, and to what."""
COMMANDS = (rename, delete, merge, split, add, gravity, floor)


def _anchors(path: Path, names: list[str]) -> list[Any]:
    from scenewright.schemas.panoptic_map import PanopticMap
    from scenewright.stages.edit.anchoring import anchor_of
    from scenewright.stages.edit.map_state import read_state
    from scenewright.stages.engine.reading import open_artifact

    opened = open_artifact(path, PanopticMap)
    assert isinstance(opened, PanopticMap)
    state, _ = read_state(opened)
    return [anchor_of(state, _instance(state, name, path)).model_dump(by_alias=True) for name in names]


def _instance(state: MapState, name: str, path: Path) -> int:
    """Return the instance that is called so. Raises UsageError when the map has none with a surface."""
    things = {thing.name: thing.instance for thing in state.things()}
    found = things.get(name) or next((k for k in things.values() if str(k) == name), None)
    if found is None:
        shown = ", ".join(list(things)[:12]) + (", ..." if len(things) > 12 else "")
        raise UsageError(f"{path}: has no thing {name!r:.80}", hint=f"it has: {shown or 'none'}")
    return found


def append(file: Path, by: str, note: str, **values: Any) -> int:
    """Add the edit that somebody asks for now to the file, and say what to do next."""
    from scenewright.stages.edit.edits_file import append_edits

    edits = append_edits(file, [asked_edit(by, note, values)])
    where = APPLIED_BY.get(values["what"], "map --panoptic-map")
    say(f"edit {len(edits.edits)} of {file}; next: scenewright edit {where} ... --edits {file} --out ...")
    out(str(file))
    return 0


def asked_edit(by: str, note: str, values: Mapping[str, Any]) -> AnyEdit:
    """Return the edit that somebody asks for now; `values` are its fields. Raises UsageError for what is none."""
    from pydantic import TypeAdapter, ValidationError
    from scenewright.schemas.edits import AnyEdit

    said = {"by": cleaned(by or _account()), "when": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}", "note": cleaned(note)}
    try:
        edit: AnyEdit = TypeAdapter(AnyEdit).validate_python({**values, **said})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        raise UsageError(f"edit {values.get('what')}: {where:.200}: {first['msg']:.200}", hint="see --help") from None
    return edit


def _account() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""

"""Commands that serve a page, and what the pages say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from unittest import mock

from scenewright.cli.main import run
from scenewright.cli.viewing.desk.desk import Desk

from tests.advice.inputs import folder, golden, room, seen
from tests.advice.rows import Tried

DESK = "cli/viewing/desk/"
RENAME = {"what": "rename", "of": "cup_3", "class": "bottle"}


def given_recording(place: Path) -> None:
    """Three cuts of a cucumber."""
    from tests.unit.cutting.test_recording import WIDTH, Session, across

    session = Session(place / "cuts.json", "cucumber", 0)
    for share in (0.3, 0.5, 0.7):
        session.cut(across(share * WIDTH))
    session.finish("slices")


def recorded() -> int:
    """Go on with the recording, and stop at once."""
    with mock.patch("scenewright.stages.cutting.recording.server.RecordingServer.serve_forever"):
        return run(["cutting", "record", "cuts.json"])


def shown(edits: str | None, read_only: bool = False) -> Callable[[], object]:
    """Return what writes an edit on the page of a map."""

    def write() -> object:
        desk = Desk(Path(seen()), Path(edits) if edits else None, read_only=read_only)
        return desk.append(RENAME, artifact=desk.shown, revision="", by="a person", note="")

    return write


def next_of(artifact: Callable[[], str]) -> Callable[[], object]:
    """Return what says how the edits of an artifact's page are applied."""
    return lambda: Desk(Path(artifact()), Path("edits.toml"))._facts()["next"]


def graph() -> str:
    """Return a contact graph."""
    return golden() + "/contact_graph"


def scene() -> str:
    """Return a CAD scene."""
    return golden() + "/cad_scene"


def language() -> str:
    """Return a language map of colours."""
    from tests.unit.viewing.test_asking import make_language

    made = folder() / "colours"
    if not made.exists():
        made.mkdir()
        make_language(made)
    return str(made / "language")


def asked(of: Callable[[], str], known: bool = False) -> Callable[[], object]:
    """Return what asks a page for something red; `known`: the encoder of colours is our own."""

    def ask() -> object:
        from tests.unit.open_words.stand_ins import ColorEncoder

        desk = Desk(Path(of()), None)
        if not known:
            return desk.ask("red")
        with mock.patch("scenewright.cli.viewing.desk.asking.open_encoder", lambda *_: ColorEncoder()):
            return desk.ask("red")

    return ask


def queried() -> int:
    """Ask the map with its own encoder."""
    from tests.unit.open_words.stand_ins import ColorEncoder

    with mock.patch("scenewright.stages.splat.query_stage.open_encoder", lambda *_: ColorEncoder()):
        return run(["splat", "query", "--language", language(), "--text", "red", "--out", "q", "--encoder", "service"])


def given_edits(place: Path) -> None:
    """A file that says nothing yet."""
    (place / "edits.toml").write_text('format = "scenewright-edits"\nversion = 1\nedits = []\n')


def applied(file: str, says: str, artifact: Callable[[], str], command: str) -> Tried:
    """Return the row of a page's next command."""
    then = f"edit {command} --edits edits.toml --out edited --dry-run"
    return Tried(DESK + file, says, next_of(artifact), then, code=0, given=given_edits)


ROWS = [
    Tried(
        "cli/record_command.py",
        "next: scenewright cutting demonstrate",
        recorded,
        "cutting demonstrate --record cuts.json --image-width 300 --out shown",
        code=0,
        given=given_recording,
    ),
    Tried(
        "cli/timeline_command.py",
        "--snapshot-every",
        "timeline {golden}/contact_graph",
        "segment --sequence {room}/sequence --backend ground-truth --out s && "
        "fuse --sequence {room}/sequence --segments s --snapshot-every 2 --voxel-size 0.05 --out m && "
        "graph --panoptic-map m --out g && timeline g",
        code=3,
        shows="2 frames:",
    ),
    Tried(
        "cli/view_command.py",
        "--read-only needs --edit",
        "view {seen} --read-only",
        shown("edits.toml"),
        right=lambda place: (place / "edits.toml").stat(),
    ),
    Tried(
        DESK + "desk.py",
        "start it without --read-only, with --edit",
        shown("edits.toml", read_only=True),
        shown("edits.toml"),
        right=lambda place: (place / "edits.toml").stat(),
    ),
    Tried(DESK + "desk.py", "scenewright splat language", asked(lambda: room() + "/sequence"), asked(language, True)),
    Tried(DESK + "asking.py", "scenewright splat query --encoder", asked(language), queried),
    applied("desk.py", "{} --edits {} --out ...", seen, "map --panoptic-map {seen}"),
    applied("subject.py", "scenewright edit {} {}", seen, "map --panoptic-map {seen}"),
    applied("map_subject.py", "map --panoptic-map", seen, "map --panoptic-map {seen}"),
    applied("graph_subject.py", "graph --contact-graph", graph, "graph --contact-graph {golden}/contact_graph"),
    applied("scene_subject.py", "scene --cad-scene", scene, "scene --cad-scene {golden}/cad_scene"),
]

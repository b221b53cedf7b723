"""`scenewright ask`: things, places on them, near misses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.cli.asking.asked_scene import AskedScene
from scenewright.cli.asking.free_places import free_places
from scenewright.cli.asking.reaching import Reaching
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.panoptic_map import Because, BecauseFile
from scenewright.schemas.scene_parts import Box, Relation, SurfacePlane
from scenewright.stages.engine.reading import open_artifact

from benchmarks.perfect_maps import write_map
from tests.unit.viewing.artifacts import seal
from tests.unit.viewing.test_explaining import run

TOP = 0.7
"""Height of the table [m]."""
CLASSES = {1: "floor", 2: "table", 3: "cup", 4: "jug"}


def grid(low: tuple[float, float], high: tuple[float, float], level: float, color: str = "white") -> trimesh.Trimesh:
    """A level sheet with a vertex a centimetre."""
    x, y = (np.arange(a, b + 1e-9, 0.01) for a, b in zip(low, high, strict=True))
    vertices = np.array([(a, b, level) for a in x for b in y])
    rows = np.arange(len(x) * len(y)).reshape(len(x), len(y))
    a, b, c, d = rows[:-1, :-1].ravel(), rows[1:, :-1].ravel(), rows[:-1, 1:].ravel(), rows[1:, 1:].ravel()
    paint = {"white": (250, 250, 250), "red": (200, 20, 20)}[color]
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    return trimesh.Trimesh(vertices, faces, vertex_colors=np.tile((*paint, 255), (len(vertices), 1)), process=False)


def node(name: str, kind: str = "rigid", **more: object) -> GraphNode:
    instance = next((k for k, class_name in CLASSES.items() if name.startswith(class_name)), 0)
    return GraphNode(id=name, instance=instance, class_name=name.split("_")[0], node_type=kind, **more)  # type: ignore[arg-type]


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A table of 1.2 x 0.8 m with a red cup and, over its left half, a jug's sheet 10 cm higher."""
    meshes = {
        1: grid((-1.5, -1.5), (1.5, 1.5), 0.0),
        2: grid((-0.6, -0.4), (0.6, 0.4), TOP),
        3: grid((0.4, 0.2), (0.48, 0.28), TOP + 0.1, "red"),
        4: grid((-0.6, -0.4), (-0.1, 0.4), TOP + 0.1),
    }
    root = tmp_path / "map"
    write_map(root, meshes, CLASSES)
    rows = [
        Because(instance=k, shape="masks", looks=30.0, said={name: 0.5}, name="rule", posterior=0.95)
        for k, name in CLASSES.items()
    ]
    rows[3] = rows[3].model_copy(update={"posterior": 0.6, "runners_up": {"bottle": 0.3}})
    BecauseFile(entities=tuple(rows)).write(root / "because.json")
    seal(root, "panoptic_map")
    plane = SurfacePlane(
        normal=(0, 0, 1), offset=-TOP, area=0.96, center=(0, 0, TOP), horizontal=True,
        corners=((-0.6, -0.4, TOP), (0.6, -0.4, TOP), (0.6, 0.4, TOP), (-0.6, 0.4, TOP)),
    )  # fmt: skip
    cup = Box(center=(0.44, 0.24, TOP + 0.05), size=(0.08, 0.08, 0.1))
    nodes = (
        GraphNode(id="scene", instance=0, class_name="scene", node_type="scene"), node("floor_1", "layout"),
        node("table_2", planes=(plane,)), node("cup_3", box=cup), node("jug_4"),
    )  # fmt: skip
    links = [("scene", "floor_1"), ("floor_1", "table_2"), ("table_2", "cup_3"), ("table_2", "jug_4")]
    relations = tuple(Relation(source=a, target=b, relation="supports", confidence=1.0) for a, b in links)
    (tmp_path / "graph").mkdir()
    ContactGraphFile(nodes=nodes, links=relations).write(tmp_path / "graph" / "graph.json")
    seal(tmp_path / "graph", "contact_graph", panoptic_map=root)
    return tmp_path


def test_a_free_disc_lies_where_nothing_stands(room: Path) -> None:
    """Free is from the jug's sheet at x = -0.1 to the edge at 0.6: a disc of half that, about x = 0.25, but for the
    cup in its corner."""
    (place,) = free_places(AskedScene(open_artifact(room / "graph")), 0.1, 0.2)
    assert place.on == "table_2" and place.center[2] == TOP
    assert 0.28 <= place.radius <= 0.36 and abs(place.center[0] - 0.23) < 0.06 and place.center[1] < 0.05
    assert 0.45 < place.area < 0.7 * 0.8
    assert free_places(AskedScene(open_artifact(room / "graph")), 0.45, 0.2) == []


def test_what_is_higher_than_the_thing_is_not_in_its_way(room: Path) -> None:
    (place,) = free_places(AskedScene(open_artifact(room / "graph")), 0.1, 0.06)
    assert place.radius == pytest.approx(0.4, abs=0.03)


def test_a_robot_gets_to_the_table_and_not_to_the_sky(room: Path) -> None:
    reaching = Reaching(AskedScene(open_artifact(room / "graph")), "panda")
    near = reaching.to((0.3, 0.0, TOP))
    assert near.reached and near.base is not None
    assert near == reaching.to((0.3, 0.0, TOP))
    assert not reaching.to((0.3, 0.0, 3.0)).reached


def ask(room: Path, capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    capsys.readouterr()
    assert run(["ask", str(room), *words]) == code
    return capsys.readouterr().out


def test_things_are_told_with_their_carrier_and_how_sure(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph = room / "graph"
    assert ask(graph, capsys, "red cup").startswith("cup_3 on table_2 at 0.44 0.24 0.75, 0.88 sure")
    assert "cup_3" in ask(graph, capsys, "something to drink from on the table")
    told = json.loads(ask(graph, capsys, "mug", "--json"))
    assert told["things"][0]["name"] == "cup_3" and told["things"][0]["how"] == "a synonym"
    assert "rests on one doubtful name: jug" in ask(graph, capsys, "jug")
    assert ask(graph, capsys, "how many cups are there").splitlines()[0] == "1: cup"


def test_what_is_not_there_is_said_with_what_comes_near(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph = room / "graph"
    assert ask(graph, capsys, "bottle", code=4) == "no bottle; nearest: jug_4 on table_2 (0.31)\n"
    assert ask(graph, capsys, "blue cup", code=4).startswith("no blue cup; nearest: cup_3")
    assert "whether there is gizmowatt is unknown" in ask(graph, capsys, "gizmowatt", code=4)


def test_places_are_told_and_what_can_be_asked(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    graph = room / "graph"
    told = ask(graph, capsys, "where can I put the cup?")
    assert "on table_2" in told and "as large as cup_3" in told
    assert "panda gets there from" in ask(graph, capsys, "where can I put the cup?", "--robot", "panda")
    assert "no free level place" in ask(graph, capsys, "where can I put the sofa?", code=4)
    assert ask(graph, capsys, "--what").startswith("things: cup (1), jug (1), table (1)\nperhaps: bottle\n")


def test_what_cannot_be_asked_is_said_in_a_line(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, code, said in (
        (["где чашка"], 2, "not English"),
        (["x" * 10_000], 2, "10000 characters"),
        (["the red blue cup"], 2, "at once"),
        ([""], 2, "needs words"),
    ):
        assert run(["ask", str(room / "graph"), *words]) == code
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
    assert run(["ask", str(room / "map"), "where can I put the cup?"]) == 2
    assert "contact graph" in capsys.readouterr().err
    (room / "nameless").mkdir()
    write_map(room / "nameless", {2: grid((0, 0), (0.1, 0.1), 0.5)}, {2: "object"})
    seal(room / "nameless", "panoptic_map")
    assert run(["ask", str(room / "nameless"), "cup"]) == 3
    assert "nothing in it has a name" in capsys.readouterr().err

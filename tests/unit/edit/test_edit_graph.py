"""Edits of graphs: a support that a person pins, marks that `urdf` heeds, on other graphs too, or a conflict."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenewright.cli.main import run as scenewright
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile
from scenewright.schemas.edits import AppliedEdit, GraphEdit
from scenewright.stages.edit.anchoring import Fitting, anchor_of_node
from scenewright.stages.edit.applying import apply_edits
from scenewright.stages.edit.edits_file import read_edits
from scenewright.stages.edit.graph_edits import GRAPH_EDITS, GraphState
from scenewright.stages.edit.parameters import EditMapParameters

from tests.unit.edit.maps import room_map

FITTING = Fitting(**EditMapParameters().model_dump())


def built(root: Path, **room: object) -> ContactGraph:
    """The contact graph of the room, by the step."""
    made = room_map(root / "map", **room)  # type: ignore[arg-type]
    assert scenewright(["graph", "--panoptic-map", str(made.root), "--out", str(root / "graph")]) == 0
    return ContactGraph(root / "graph")


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> ContactGraph:
    return built(tmp_path_factory.mktemp("graph"))


def edit(what: type[GraphEdit], graph: ContactGraph, name: str, **values: object) -> GraphEdit:
    things = {thing.name: thing for thing in GraphState(graph.info).things()}
    if values.get("on"):
        values["on"] = anchor_of_node(things[str(values["on"])])
    kind = "support" if "on" in values else "mark"
    return what.model_validate({"what": kind, "of": anchor_of_node(things[name]), **values})


def support(graph: ContactGraph, name: str, on: str | None, **values: object) -> GraphEdit:
    from scenewright.schemas.edits import Support

    return edit(Support, graph, name, on=on, **values)


def mark(graph: ContactGraph, name: str, as_: str) -> GraphEdit:
    from scenewright.schemas.edits import Mark

    return edit(Mark, graph, name, **{"as": as_})


def applied(graph: ContactGraph, *edits: GraphEdit) -> tuple[ContactGraphFile, list[AppliedEdit]]:
    state = GraphState(graph.info)
    records = apply_edits(state, edits, FITTING, GRAPH_EDITS)
    state.graph.check_read()
    return state.graph, records


def parent(graph: ContactGraphFile, name: str) -> tuple[str, str]:
    link = graph.parent_link(name)
    assert link is not None
    return link.source, link.relation


def test_a_pinned_support_has_the_plane_that_fits_best(graph: ContactGraph) -> None:
    assert parent(graph.info, "cup_3") == ("table_2", "supports")
    here, (record,) = applied(graph, support(graph, "cup_3", "floor_1"))
    assert record.status == "applied" and record.reason == "floor_1 supports it, not table_2"
    link = here.parent_link("cup_3")
    assert link is not None and link.confidence == 1.0 and link.gap == pytest.approx(0.75, abs=0.02)
    floor = here.node("floor_1").planes[link.plane or 0]
    assert floor.horizontal and abs(floor.offset) < 0.02
    # The box reaches down to what carries it, as that of `graph` does.
    box = here.node("cup_3").box
    assert box is not None and box.center[2] - box.size[2] / 2 == pytest.approx(0.0, abs=0.02)
    assert [link.target for link in here.links].count("cup_3") == 1 or parent(here, "cup_3") == ("floor_1", "supports")


def test_what_is_pinned_inside_lies_on_a_plane_that_nobody_saw(graph: ContactGraph) -> None:
    here, records = applied(graph, support(graph, "cup_4", "cabinet_5", relation="contains"))
    link = here.parent_link("cup_4")
    assert records[0].status == "applied" and link is not None and link.relation == "contains"
    # They do not lie above each other: the relation is as the person says, and nothing was measured.
    assert link.plane is None and link.gap is None
    thin = graph.info.node("table_2").model_copy(update={"planes": ()})
    state = GraphState(graph.info)
    state.replace_node(thin)
    state.graph = state.graph.model_copy(
        update={"links": tuple(k.model_copy(update={"plane": None}) for k in state.graph.links)}
    )
    apply_edits(state, [support(graph, "cup_3", None), support(graph, "cup_3", "table_2")], FITTING, GRAPH_EDITS)
    link, table = state.graph.parent_link("cup_3"), state.graph.node("table_2")
    assert link is not None and link.plane == 0 and link.gap == 0.0 and table.planes[0].hidden
    assert table.planes[0].center[2] == pytest.approx(0.75, abs=0.01)


def test_nothing_carries_what_a_person_says_hangs_in_the_world(graph: ContactGraph) -> None:
    here, (record,) = applied(graph, support(graph, "cup_3", None))
    assert parent(here, "cup_3") == (SCENE_NODE, "unknown") and record.things == ("cup_3",)
    again, (second,) = applied(graph, support(graph, "cup_3", "table_2"))
    assert second.status == "already"
    link = again.parent_link("cup_3")
    assert link is not None and link.confidence == 1.0 and link.plane is not None


def test_what_cannot_be_is_a_conflict_and_changes_nothing(graph: ContactGraph) -> None:
    for asked, words in (
        (support(graph, "table_2", "cup_3"), "stands on it"),
        (support(graph, "table_2", "table_2"), "table_2 is table_2"),
        (support(graph, "floor_1", "table_2"), "part of the building"),
        (mark(graph, "floor_1", "movable"), "part of the building"),
    ):
        here, (record,) = applied(graph, asked)
        assert record.status == "conflict" and words in record.reason, record
        assert here == graph.info
    hung, records = applied(
        graph, support(graph, "cup_3", "cabinet_5", relation="carries_on_wall"), mark(graph, "cup_3", "movable")
    )
    assert [record.status for record in records] == ["applied", "conflict"] and "fall" in records[1].reason
    assert hung.node("cup_3").mark is None


def test_edits_land_whatever_the_numbers_and_say_what_is_gone(graph: ContactGraph, tmp_path: Path) -> None:
    asked = [support(graph, "cup_3", "floor_1"), mark(graph, "table_2", "fixed")]
    other = built(tmp_path / "other", spacing=0.04, number={3: 40, 4: 3, 2: 5, 5: 2})
    there, records = applied(other, *asked)
    assert [(record.status, record.things) for record in records] == [
        ("applied", ("cup_40",)),
        ("applied", ("table_5",)),
    ]
    assert parent(there, "cup_40") == ("floor_1", "supports") and parent(there, "cup_3")[0] == "table_5"
    gone = built(tmp_path / "gone", without=(3,))
    there, records = applied(gone, *asked)
    assert [record.status for record in records] == ["conflict", "applied"] and "table_2, whose box" in records[
        0
    ].reason


def test_the_step_writes_a_graph_and_the_commands_write_lines(graph: ContactGraph, tmp_path: Path, capsys) -> None:
    edits, out = tmp_path / "edits.toml", tmp_path / "edited"
    on = ["--contact-graph", str(graph.root), "--by", "anna"]
    assert scenewright(["edit", "mark", str(edits), "table_2", "fixed", *on, "--note", '<b>"bolted" down']) == 0
    assert scenewright(["edit", "support", str(edits), "4", "--on", "floor_1", *on]) == 0
    assert scenewright(["edit", "support", str(edits), "cup_3", "--on", "nothing", *on]) == 0
    assert [line.what for line in read_edits(edits).edits] == ["mark", "support", "support"]
    apply = ["edit", "graph", "--contact-graph", str(graph.root), "--edits", str(edits), "--out", str(out)]
    assert scenewright(apply) == 0
    made = ContactGraph(out)
    assert made.edits is not None and [k.status for k in made.edits.edits] == ["applied"] * 3
    assert made.edits.edits[0].by == "anna" and made.edits.edits[0].note == '<b>"bolted" down'
    assert made.info.node("table_2").mark == "fixed" and parent(made.info, "cup_4") == ("floor_1", "supports")
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["summary"]["pinned"] == 2 and manifest["summary"]["marked"] == 1
    # What is no edit of graphs is left to the others, and keeps its number.
    text = edits.read_text()
    box = "{ center = [0.0, 0.0, 1.0], size = [0.1, 0.1, 0.1] }"
    edits.write_text(text.replace("edits = [", f'edits = [\n  {{ what = "add", box = {box}, class = "cup" }},'))
    assert scenewright(apply) == 0
    made = ContactGraph(out)
    assert made.edits is not None and [k.number for k in made.edits.edits] == [2, 3, 4]
    assert json.loads((out / "manifest.json").read_text())["summary"]["elsewhere"] == 1
    # Undo is deleting a line.
    edits.write_text("\n".join(k for k in edits.read_text().splitlines() if "mark" not in k) + "\n")
    assert scenewright(apply) == 0 and ContactGraph(out).info.node("table_2").mark is None
    capsys.readouterr()
    for wrong, words in (
        (["support", str(edits), "mug_9", "--on", "floor_1"], "has no thing 'mug_9'"),
        (["support", str(edits), "cup_3", "--on", "<script>" + "x" * 9000], "has no thing"),
    ):
        before = edits.read_bytes()
        assert scenewright(["edit", *wrong, *on]) == 2
        error = capsys.readouterr().err
        assert words in error and len(error.strip().splitlines()) <= 2 and len(error) < 500
        assert edits.read_bytes() == before

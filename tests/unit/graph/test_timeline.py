"""The graph while the map grows: lasting ids, what changed, and the finished graph at its end."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.cli.timeline_command import timeline as timeline_command
from scenewright.schemas.contact_graph import ContactGraph, TimelineFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import SNAPSHOTS, EntitiesFile, PanopticMap
from scenewright.stages.engine import reading
from scenewright.stages.graph import entities as entities_module
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run
from scenewright.stages.graph.timeline import lasting_ids
from scenewright.stages.graph.tracks import CELL, cells_of
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.panoptic_maps import box_mesh, floor_mesh, table_mesh, write_map

TABLE = table_mesh((0.0, 0.0), (1.2, 0.7, 0.75))
TOP = box_mesh((-0.6, -0.35, 0.71), (0.6, 0.35, 0.75))
LEFT, RIGHT = TOP.slice_plane([0, 0, 0], [-1, 0, 0], cap=True), TOP.slice_plane([0, 0, 0], [1, 0, 0], cap=True)
BOOK = box_mesh((-0.3, -0.1, 0.75), (-0.1, 0.1, 0.79))
CUP = box_mesh((0.2, 0.0, 0.75), (0.28, 0.08, 0.86))


def set_frames(panoptic_map: PanopticMap, frames: int) -> None:
    path = panoptic_map.path("entities.json")
    EntitiesFile.read(path).model_copy(update={"frames_integrated": frames}).write(path)


@pytest.fixture(scope="module")
def grown(tmp_path_factory: pytest.TempPathFactory) -> tuple[ContactGraph, TimelineFile]:
    """After 10 frames two halves of a table top, taken for a desk and a table; after 20 the table, and a box on it that
    is a book at last, and a cup."""
    folder = tmp_path_factory.mktemp("timeline")
    floor = floor_mesh()
    stages = {
        10: ({1: floor, 2: LEFT, 3: RIGHT}, {1: "floor", 2: "desk", 3: "table"}),
        20: ({1: floor, 2: TABLE, 4: BOOK}, {1: "floor", 2: "table", 4: "box"}),
        30: ({1: floor, 2: TABLE, 4: BOOK, 5: CUP}, {1: "floor", 2: "table", 4: "book", 5: "cup"}),
    }
    for frames, (meshes, classes) in stages.items():
        place = folder / "map" if frames == 30 else folder / "map" / SNAPSHOTS / f"{frames:06d}"
        fine = {k: mesh.subdivide_to_size(0.1) for k, mesh in meshes.items()}
        set_frames(write_map(place, fine, classes), frames)
    (folder / "graph").mkdir()
    context = Context(output=folder / "graph", seed=0, device="cpu", progress=SilentProgress())
    artifact = run(PanopticMap(folder / "map"), parameters=GraphParameters(), context=context)
    timeline = artifact.timeline
    assert timeline is not None and artifact.summary["snapshots"] == 3
    return artifact, timeline


def test_the_last_snapshot_is_the_graph_of_the_finished_map(grown, tmp_path):
    artifact, timeline = grown
    last = timeline.snapshots[-1]
    assert last.frames == 30 and last.links == artifact.info.links
    bare = [node.model_copy(update={"planes": (), "mesh": None}) for node in artifact.info.nodes]
    assert list(last.nodes) == bare
    # ... which is the same graph as without snapshots.
    context = Context(output=tmp_path, seed=0, device="cpu", progress=SilentProgress())
    finished = artifact.root.parent / "map"
    (finished / SNAPSHOTS).rename(tmp_path / "elsewhere")
    alone = run(PanopticMap(finished), parameters=GraphParameters(), context=context)
    (tmp_path / "elsewhere").rename(finished / SNAPSHOTS)
    assert alone.timeline is None and alone.info == artifact.info


def test_ids_last_whatever_a_thing_was_called(grown):
    _, timeline = grown
    ids = [[node.id for node in snapshot.nodes] for snapshot in timeline.snapshots]
    assert ids[1] == ["scene", "floor_1", "table_2", "book_4"] and ids[2] == [*ids[1], "cup_5"]
    # One half of the top became the table; the other keeps the name that it had.
    assert ids[0][:2] == ["scene", "floor_1"] and "table_2" in ids[0] and len(set(ids[0])) == 4


def test_what_changed(grown):
    first, second, third = (snapshot.changes for snapshot in grown[1].snapshots)
    assert len(first.appeared) == 3 and not first.vanished and not first.reattached
    assert second.appeared == ("book_4",) and list(second.merged.values()) == ["table_2"]
    assert third.appeared == ("cup_5",) and third.renamed == {"book_4": "box"} and not third.merged
    assert third.count == 2 + len(third.added) + len(third.removed) + len(third.reattached)


def test_what_did_not_change_is_not_looked_at_again(tmp_path, monkeypatch):
    looked = []
    honest = entities_module.load_entity

    def counting(panoptic_map, entry, method, parameters, context):
        looked.append(entry.instance)
        return honest(panoptic_map, entry, method, parameters, context)

    monkeypatch.setattr(entities_module, "load_entity", counting)
    meshes, classes = {1: floor_mesh(), 4: BOOK}, {1: "floor", 4: "book"}
    write_map(tmp_path / "map" / SNAPSHOTS / "000010", {1: meshes[1]}, classes)
    write_map(tmp_path / "map", meshes, classes)
    (tmp_path / "graph").mkdir()
    context = Context(output=tmp_path / "graph", seed=0, device="cpu", progress=SilentProgress())
    run(PanopticMap(tmp_path / "map"), parameters=GraphParameters(), context=context)
    assert looked == [1, 4]


def test_lasting_ids():
    assert lasting_ids([{0: "box_1", 1: "cup_2"}, {0: "book_1", 2: "box_1"}]) == {0: "book_1", 1: "cup_2", 2: "box_1"}
    assert lasting_ids([{0: "cup_2"}, {1: "cup_2"}]) == {0: "cup_2.2", 1: "cup_2"}


def test_cells():
    points = np.array([[0.001, 0.001, 0.001], [0.002, 0.0, 0.0], [CELL + 0.001, 0.0, 0.0], [-0.001, 0.0, 0.0]])
    assert len(cells_of(points)) == 3 and len(cells_of(np.zeros((0, 3)))) == 0
    assert trimesh.util.allclose(cells_of(points), np.sort(cells_of(points[::-1])))


def test_the_command_prints_changes_or_the_file(grown, monkeypatch, capsys, tmp_path):
    artifact, timeline = grown
    monkeypatch.setattr(reading, "open_artifact", lambda path, kind: ContactGraph(path))
    assert timeline_command(artifact.root) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"10 frames: 3 nodes, {len(timeline.snapshots[0].links)} links"
    assert "  + book_4" in lines and "  ~ book_4 was taken for box" in lines
    assert timeline_command(artifact.root, json_output=True) == 0
    assert TimelineFile.model_validate_json(capsys.readouterr().out) == timeline
    with pytest.raises(BadInput, match="kept no snapshots"):
        timeline_command(tmp_path)

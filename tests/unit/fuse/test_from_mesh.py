"""Annotated scans as panoptic maps: every layout, and what is wrong with the broken ones."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.fuse import from_mesh
from scenewright.stages.fuse.annotated_scan import read_scan
from scenewright.stages.fuse.parameters import FuseParameters, check
from scenewright.stages.fuse.stage import run
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run as graph
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.panoptic_maps import box_mesh, floor_mesh, table_mesh
from tests.real_data import real_data

THINGS = {"floor": 1, "table": 2, "box": 3, "wall": 4}
SPACING = 0.04


def room(up: np.ndarray | None = None) -> tuple[trimesh.Trimesh, np.ndarray]:
    """A floor, a table, a box on it and two walls, and the number of each vertex's thing; `up` turns all of it."""
    parts = [
        (floor_mesh(), 1),
        (table_mesh(), 2),
        (box_mesh((-0.2, -0.1, 0.75), (0.1, 0.1, 0.95)), 3),
        (box_mesh((-1.2, 1.2, 0.0), (1.2, 1.25, 1.5)), 4),
    ]
    pieces, labels = [], []
    for mesh, number in parts:
        vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, SPACING)
        pieces.append(trimesh.Trimesh(vertices, faces, process=True))
        labels.append(np.full(len(pieces[-1].vertices), number))
    whole = trimesh.util.concatenate(pieces)
    if up is not None:
        whole.vertices = whole.vertices @ up.T
    return whole, np.concatenate(labels)


def write_ply(path: Path, mesh: trimesh.Trimesh, **columns: np.ndarray) -> None:
    """A binary PLY with further columns of the vertices."""
    rows = np.zeros(len(mesh.vertices), [("xyz", "<f4", 3), ("rgb", "u1", 3), *((name, "<u2") for name in columns)])
    rows["xyz"], rows["rgb"] = mesh.vertices, 90
    for name, values in columns.items():
        rows[name] = values
    faces = np.zeros(len(mesh.faces), [("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, mesh.faces
    further = "".join(f"property ushort {name}\n" for name in columns)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\nproperty float x\nproperty float y\n"
        f"property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n{further}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + rows.tobytes() + faces.tobytes())


def scannet(root: Path) -> None:
    mesh, labels = room()
    write_ply(root / "scene_vh_clean_2.ply", mesh)
    # Two segments a thing: 2 k and 2 k + 1.
    segments = 2 * labels + (np.arange(len(labels)) % 2)
    text = json.dumps({"sceneId": "scene", "segIndices": segments.tolist()})
    (root / "scene_vh_clean_2.0.010000.segs.json").write_text(text)
    rows = [{"id": k, "segments": [2 * k, 2 * k + 1], "label": name} for name, k in THINGS.items()]
    (root / "scene.aggregation.json").write_text(json.dumps({"segGroups": rows}))


def replica(root: Path) -> None:
    mesh, labels = room()
    owner = labels[mesh.faces[:, 0]]
    faces = np.zeros(len(mesh.faces), [("n", "u1"), ("i", "<i4", 4), ("o", "<i4")])
    faces["n"], faces["i"], faces["o"] = 4, mesh.faces[:, [0, 1, 2, 2]], owner - 1  # ids from 0 on; quads
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\n"
        "property int object_id\nend_header\n"
    )
    (root / "habitat").mkdir()
    body = mesh.vertices.astype("<f4").tobytes() + faces.tobytes()
    (root / "habitat" / "mesh_semantic.ply").write_bytes(header.encode() + body)
    objects = [{"id": k - 1, "class_name": name, "class_id": 9} for name, k in THINGS.items()]
    (root / "habitat" / "info_semantic.json").write_text(json.dumps({"objects": objects}))


def scenenn(root: Path) -> None:
    tilt = trimesh.transformations.rotation_matrix(-1.4, [1, 0.2, 0])[:3, :3]  # as a hand-held camera began
    mesh, labels = room(tilt)
    write_ply(root / "011.ply", mesh, label=100 * labels)
    rows = "".join(f'<label id="{100 * k}" text="my {name}" nyu_class="{name}"/>' for name, k in THINGS.items())
    (root / "011.xml").write_text(f"<annotation>{rows}</annotation>")


def nyu40(root: Path) -> None:
    mesh, labels = room()
    write_ply(root / "scene_vh_clean_2.labels.ply", mesh, label=np.array([0, 2, 7, 29, 1])[labels])


def points(root: Path) -> None:
    mesh, labels = room()
    places, face = trimesh.sample.sample_surface_even(mesh, 60000, seed=1)
    owner = labels[mesh.faces[face, 0]]
    np.savez(
        root / "points.npz",
        points=places.astype(np.float32),
        instance=owner,
        id=np.array([*THINGS.values()]),
        classes=np.array([*THINGS]),
    )


LAYOUTS: dict[str, Callable[[Path], None]] = {
    "ScanNet": scannet,
    "Replica": replica,
    "SceneNN": scenenn,
    "NYU40 labels": nyu40,
    "points": points,
}


def context(out: Path) -> Context:
    out.mkdir(parents=True)
    return Context(output=out, seed=0, device="cpu", progress=SilentProgress())


def made(scan: Path, out: Path, labels: Path | None = None, **options: str) -> PanopticMap:
    return run(from_mesh=scan, labels=labels, parameters=FuseParameters(**options), context=context(out))


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_graph_is_built_of_every_layout(tmp_path: Path, name: str) -> None:
    (tmp_path / "scan").mkdir()
    LAYOUTS[name](tmp_path / "scan")
    panoptic_map = made(tmp_path / "scan", tmp_path / "map")
    assert panoptic_map.outcome == "ok" and panoptic_map.summary["layout"] == name
    classes = {entity.instance: entity.class_name for entity in panoptic_map.info.entities}
    assert sorted(classes.values()) == sorted(THINGS)
    by_class = {entity.class_name: entity for entity in panoptic_map.info.entities}
    table = load_entity_mesh(panoptic_map.path(by_class["table"].mesh)).vertices
    assert np.ptp(table, axis=0) == pytest.approx([1.2, 0.7, 0.75], abs=0.05)
    with np.load(panoptic_map.path("mesh_labels.npz"), allow_pickle=False) as labels:
        assert set(np.unique(labels["instance"]).tolist()) - {0} == set(classes)
    contact = graph(panoptic_map, parameters=GraphParameters(), context=context(tmp_path / "graph"))
    carried = {
        (link.source.rsplit("_", 1)[0], link.target.rsplit("_", 1)[0])
        for link in contact.info.links
        if link.relation == "supports"
    }
    assert {("floor", "table"), ("table", "box")} <= carried


def test_the_same_scan_gives_the_same_bytes(tmp_path: Path) -> None:
    (tmp_path / "scan").mkdir()
    scannet(tmp_path / "scan")
    first, second = made(tmp_path / "scan", tmp_path / "a"), made(tmp_path / "scan", tmp_path / "b")
    files = sorted(path.relative_to(first.root) for path in first.root.rglob("*") if path.is_file())
    assert files and all((first.root / file).read_bytes() == (second.root / file).read_bytes() for file in files)


def test_a_fine_mesh_is_thinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "scan").mkdir()
    nyu40(tmp_path / "scan")
    whole = made(tmp_path / "scan", tmp_path / "whole")
    monkeypatch.setattr(from_mesh, "KEPT_FACES", 1000)
    with caplog.at_level(logging.INFO, "scenewright"):
        coarse = run(
            from_mesh=tmp_path / "scan", parameters=FuseParameters(voxel_size=0.1), context=context(tmp_path / "coarse")
        )
    assert "more than 1000: thinned to" in caplog.text
    assert coarse.summary["faces"] < whole.summary["faces"] / 3
    assert {e.class_name for e in coarse.info.entities} == {e.class_name for e in whole.info.entities}
    monkeypatch.setattr("scenewright.stages.fuse.annotated_scan.MOST_FACES", 100)
    with pytest.raises(BadInput, match="at most 100 are read"):
        read_scan(tmp_path / "scan")


def test_labels_without_names(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    mesh, labels = room()
    write_ply(tmp_path / "mine.ply", mesh, label=labels)
    with pytest.raises(BadInput, match=r"nothing says what label 1 is \(4 such labels\)"):
        made(tmp_path / "mine.ply", tmp_path / "nameless")
    table = tmp_path / "mine.toml"
    rows = [f'{{ name = "n{k}", id = {k}, class = "{name}" }}' for name, k in THINGS.items() if name != "box"]
    table.write_text(f"labels = [{', '.join(rows)}]")
    panoptic_map = made(tmp_path / "mine.ply", tmp_path / "named", labels=table)
    assert {e.class_name for e in panoptic_map.info.entities} == {"floor", "table", "wall"}
    assert "1 without a name" in caplog.text


def test_unknown_names_become_objects(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    scannet(tmp_path)
    group = tmp_path / "scene.aggregation.json"
    group.write_text(group.read_text().replace('"box"', '"sousaphone"').replace('"wall"', '"mirror"'))
    panoptic_map = made(tmp_path, tmp_path / "map")
    assert {e.class_name for e in panoptic_map.info.entities} == {"floor", "table", "object"}  # a mirror is void
    assert "1 of its names are in no table and become `object`: sousaphone" in caplog.text


def test_broken_scans(tmp_path: Path) -> None:
    def change(file: str, old: str, new: str) -> Callable[[Path], None]:
        def write(root: Path) -> None:
            scannet(root)
            path = root / file
            text = path.read_text()
            assert old in text
            path.write_text(text.replace(old, new, 1))

        return write

    def without(name: str, layout: Callable[[Path], None] = scannet) -> Callable[[Path], None]:
        def write(root: Path) -> None:
            layout(root)
            next(root.rglob(name)).unlink()

        return write

    def nothing(root: Path) -> None:
        (root / "readme.txt").write_text("a scan")

    def leaning(root: Path) -> None:
        turn = trimesh.transformations.rotation_matrix(1.0, [1, 1, 0])[:3, :3]
        write_ply(root / "scan.ply", room(up=turn)[0])

    segments, group = "scene_vh_clean_2.0.010000.segs.json", "scene.aggregation.json"
    cases = [
        (change(segments, "[", "[7, "), "segments for the"),
        (change(segments, "[", '["7", '), "is not a list of integers"),
        (change(segments, "[2,", "[-2,"), "not in 0..2"),
        (change(segments, "{", ""), "no JSON"),
        (change(group, "segGroups", "groups"), "lists no segGroups"),
        (without("*.segs.json"), ".segs.json is not beside it"),
        (without("*.ply"), "no mesh is beside it"),
        (without("info_semantic.json", replica), "info_semantic.json is not beside it"),
        (nothing, "no labelled mesh or points that are read here"),
        (leaning, "nothing of it is labelled, and no floor is seen"),
    ]
    for k, (write, message) in enumerate(cases):
        root = tmp_path / str(k)
        root.mkdir()
        write(root)
        with pytest.raises(BadInput) as caught:
            made(root, tmp_path / f"out {k}")
        assert message in caught.value.message and "\n" not in caught.value.message


@pytest.mark.parametrize("form", ["mesh", "points", "empty labels"])
def test_a_bare_scan_is_told_apart_by_geometry(form: str, tmp_path: Path) -> None:
    """The box on the table is lower than what stands on level tops by itself, so the two are one piece."""
    mesh, _ = room()
    if form == "points":
        np.savez(tmp_path / "scan.npz", points=trimesh.sample.sample_surface(mesh, 30000, seed=0)[0].astype("f4"))
    else:
        columns = {"label": np.zeros(len(mesh.vertices), int)} if form == "empty labels" else {}
        write_ply(tmp_path / "scan.ply", mesh, **columns)
    panoptic_map = made(tmp_path, tmp_path / "out")
    found = {entity.class_name: entity for entity in panoptic_map.info.entities}
    assert panoptic_map.info.segmentation.startswith("geometry alone")
    assert {"floor", "wall"} <= set(found)
    assert found["wall"].box_minimum[1] > 1.1 and found["floor"].box_maximum[2] < 0.1
    things = [entity for entity in panoptic_map.info.entities if entity.class_name == "object"]
    table = max(things, key=lambda entity: entity.vertices)
    assert 0.7 < table.box_maximum[2] < 1.0 and table.box_minimum[2] < 0.2


def test_a_scan_takes_no_frames() -> None:
    scan, frames = {"from_mesh": Path("m")}, {"sequence": Path("s"), "segments": Path("t")}
    check(FuseParameters(), scan)
    check(FuseParameters(), {**scan, "labels": Path("l")})
    for given, message in [
        ({**scan, **frames}, "takes no --sequence"),
        ({"sequence": Path("s")}, "--segments is missing"),
        ({}, "--sequence is missing"),
        ({**frames, "labels": Path("l")}, "--labels names the labels of --from-mesh"),
    ]:
        with pytest.raises(UsageError, match=message):
            check(FuseParameters(), given)


def test_a_real_scan(tmp_path: Path) -> None:
    """ScanNet's scene0470_00 with NYU40 labels: the five chairs, the table and the bin that Scan2CAD aligned."""
    scan = real_data("scan2cad_sample") / "scannet-sample" / "scene0470_00"
    counts: dict[str, int] = {}
    for entity in made(scan, tmp_path / "map").info.entities:
        counts[entity.class_name] = counts.get(entity.class_name, 0) + 1
    assert counts["chair"] == 5 and counts["table"] == 1 and counts["floor"] == counts["wall"] == 1


Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""Turns z to y."""


def same_room(panoptic_map: PanopticMap) -> None:
    """What is found in `room` as it stands: floor, walls, and the table with the box on it."""
    found = {entity.class_name: entity for entity in panoptic_map.info.entities}
    assert {"floor", "wall", "object"} <= set(found)
    assert found["floor"].box_maximum[2] - found["floor"].box_minimum[2] < 0.1
    assert np.ptp([found["floor"].box_minimum[0], found["floor"].box_maximum[0]]) > 2
    table = max((e for e in panoptic_map.info.entities if e.class_name == "object"), key=lambda e: e.vertices)
    assert 0.7 < table.box_maximum[2] < 1.0


@pytest.mark.parametrize(("up", "turn"), [("+y", Y_UP), ("-z", np.diag([1.0, -1, -1])), ("+z", np.eye(3))])
@pytest.mark.parametrize(("unit", "a_metre"), [("mm", 1000.0), ("cm", 100.0), ("inch", 1 / 0.0254), ("m", 1.0)])
def test_a_scan_is_turned_and_scaled_as_the_options_say(
    tmp_path: Path, up: str, turn: np.ndarray, unit: str, a_metre: float
) -> None:
    mesh, _ = room(up=turn)
    mesh.vertices = mesh.vertices * a_metre
    write_ply(tmp_path / "scan.ply", mesh)
    same_room(made(tmp_path, tmp_path / "out", up=up, unit=unit))


@pytest.mark.parametrize(("unit", "a_metre"), [("mm", 1000.0), ("cm", 100.0)])
def test_a_scan_of_kilometres_is_refused_with_the_unit_that_makes_it_a_room(
    tmp_path: Path, unit: str, a_metre: float
) -> None:
    mesh, labels = room()
    mesh.vertices = mesh.vertices * a_metre
    for name, columns in (("bare", {}), ("labelled", {"label": labels})):
        write_ply(tmp_path / f"{name}.ply", mesh, **columns)
        with pytest.raises(BadInput, match="which is no room") as error:
            made(tmp_path / f"{name}.ply", tmp_path / name)
        assert f"--unit {unit} makes it 2.4" in error.value.hint.replace("3 x 2.4", "2.4")
    same_room(made(tmp_path / "bare.ply", tmp_path / "out", unit=unit))


def test_a_scan_that_lies_on_its_side_is_spoken_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_ply(tmp_path / "scan.ply", room(up=Y_UP)[0])
    made(tmp_path, tmp_path / "out")
    assert "if y is up: --up +y makes it 1.5 m high" in caplog.text


@pytest.mark.parametrize("name", ["scan.obj", "scan.stl", "scan.glb", "cloud.ply"])
def test_a_bare_scan_of_any_format(tmp_path: Path, name: str) -> None:
    mesh, _ = room()
    if name == "scan.glb":  # y is up in glTF
        mesh.vertices = mesh.vertices @ Y_UP.T
    if name == "cloud.ply":
        points = trimesh.sample.sample_surface(mesh, 30000, seed=0)[0]
        (tmp_path / name).write_bytes(trimesh.PointCloud(points).export(file_type="ply"))
    else:
        mesh.export(tmp_path / name)
    same_room(made(tmp_path / name, tmp_path / "out"))


def test_labelled_points_without_faces_are_sent_to_the_form_that_says_which_are_one_thing(tmp_path: Path) -> None:
    mesh, labels = room()
    points = trimesh.Trimesh(mesh.vertices, np.zeros((0, 3), int), process=False)
    write_ply(tmp_path / "cloud.ply", points, label=labels)
    with pytest.raises(BadInput, match="points with labels and without faces") as error:
        made(tmp_path / "cloud.ply", tmp_path / "out")
    assert "NPZ" in error.value.hint


def test_several_bare_scans_are_asked_to_be_named(tmp_path: Path) -> None:
    for name in ("a.obj", "b.obj"):
        (tmp_path / name).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(BadInput, match="2 meshes without labels, a.obj, b.obj"):
        made(tmp_path, tmp_path / "out")


def test_unit_and_up_are_of_scans_alone() -> None:
    frames = {"sequence": Path("s"), "segments": Path("t")}
    for options in ({"unit": "mm"}, {"up": "+y"}):
        with pytest.raises(UsageError, match="are those of --from-mesh"):
            check(FuseParameters(**options), frames)
        check(FuseParameters(**options), {"from_mesh": Path("m")})

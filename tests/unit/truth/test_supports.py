"""Support annotations become ground truth that `evaluate` scores graphs against; broken ones are told in one line."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.contact_graph import ContactGraph, ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.scene_parts import Relation
from scenewright.schemas.sequence import LabelEntry, Sequence
from scenewright.stages.evaluate.parameters import EvaluateParameters
from scenewright.stages.evaluate.stage import run as evaluate
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.stage import run as ingest
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.truth.annotated_points import most_common_labels
from scenewright.stages.truth.outlines import read_outlines
from scenewright.stages.truth.parameters import SupportsParameters
from scenewright.stages.truth.support_annotation import SupportAnnotation, contradictions, read_support_annotation
from scenewright.stages.truth.supports import run

from tests.panoptic_maps import box_mesh, write_map
from tests.unit.ingest.tiny_room import CAMERA, TABLE, camera_poses, room_depth

MADE = {"by": "a test", "how": "by hand", "date": "2026-11-22"}
BOX = {"center": [0.0, 0.0, 0.72], "size": [0.4, 0.3, 0.2]}
"""A thing around a part of the table's top: the smaller box wins there."""
BY_BOXES = {
    "format": "scenewright-supports",
    "version": 1,
    "scene": "tiny room",
    "made": MADE,
    "nodes": [
        {"name": "floor", "class": "floor", "find": {"box": {"center": [0, 0, 0], "size": [4, 3, 0.06]}}},
        {"name": "table", "class": "table", "find": {"box": {"center": [0, 0, 0.37], "size": [1.3, 0.9, 0.74]}}},
        {"name": "tray", "class": "tray", "find": {"box": BOX}},
        {"name": "far", "class": "box", "find": {"box": {"center": [9, 9, 9], "size": [1, 1, 1]}}},
    ],
    "relations": [
        {"child": "table", "parent": "floor"},
        {"child": "tray", "parent": "table", "also": ["far"], "leans_on": ["floor"]},
        {"child": "far", "parent": "scene"},
    ],
}


def context(folder: Path) -> Context:
    folder.mkdir(parents=True)
    return Context(output=folder, seed=0, device="cpu", progress=SilentProgress())


@pytest.fixture(scope="module")
def sequence(tmp_path_factory) -> Sequence:
    """Four frames of the tiny room with label images: 7 is the table, 3 the floor."""
    folder = tmp_path_factory.mktemp("log")
    table = [LabelEntry(instance=7, class_name="table"), LabelEntry(instance=3, class_name="floor")]
    with FrameWriter(folder / "log.mcap", CAMERA, labels=True, label_table=table) as writer:
        for k, pose in enumerate(camera_poses(4)):
            depth = room_depth(CAMERA, pose)
            points = apply(pose, back_project(depth, CAMERA).reshape(-1, 3).astype(float))
            on_table = np.all((points > TABLE[0] - 1e-3) & (points < TABLE[1] + 1e-3), axis=1) & (points[:, 2] > 0.01)
            labels = np.where(on_table, 7, np.where(points[:, 2] < 0.01, 3, 0)).reshape(depth.shape)
            color = np.full((CAMERA.height, CAMERA.width, 3), 90, np.uint8)
            writer.write(0.1 * k, color, depth, pose, labels.astype(np.uint16))
    return ingest(folder / "log.mcap", parameters=IngestParameters(), context=context(folder / "sequence"))


def written(folder: Path, document: dict) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "annotation.json"
    path.write_text(json.dumps(document))
    return path


def make(document: dict, sequence: Sequence, folder: Path, panoptic_map=None) -> GroundTruth:
    path = written(folder, document)
    return run(path, sequence, panoptic_map, parameters=SupportsParameters(), context=context(folder / "truth"))


def test_boxes_in_the_world_take_the_points_within_and_the_smallest_wins(sequence, tmp_path):
    truth = make(BY_BOXES, sequence, tmp_path)
    points, owner = read_arrays(truth.path("visible.npz"), "points", "instance")
    assert set(owner.tolist()) == {0, 1, 2, 3}
    tray = points[owner == 3]
    assert (np.abs(tray[:, :2]) <= [0.201, 0.151]).all() and len(tray) > 100
    assert len(points[owner == 1]) > 1000 and (np.abs(points[owner == 1][:, 2]) <= 0.031).all()
    links = {(link.source, link.target, link.relation) for link in truth.graph.links}
    assert links == {
        ("scene", "floor", "supports"),
        ("floor", "table", "supports"),
        ("table", "tray", "supports"),
        ("far", "tray", "also_supports"),
        ("floor", "tray", "leans_on"),
        ("scene", "far", "supports"),
    }
    assert truth.summary["unseen"] == 1


def test_labels_are_found_in_the_label_images(sequence, tmp_path):
    document = copy.deepcopy(BY_BOXES)
    document["nodes"] = [
        {"name": "floor", "class": "floor", "find": {"labels": [3]}},
        {"name": "desk", "class": "desk", "find": {"labels": [7, 8]}},
    ]
    document["relations"] = [{"child": "desk", "parent": "floor"}]
    truth = make(document, sequence, tmp_path)
    points, owner = read_arrays(truth.path("visible.npz"), "points", "instance")
    top = (points[:, 2] > 0.7) & (np.abs(points[:, 0]) < 0.55) & (np.abs(points[:, 1]) < 0.35) & (points[:, 2] < 0.74)
    assert (owner[top] == 2).all() and top.sum() > 1000
    np.testing.assert_allclose(truth.graph.node("desk").box.size[2], 0.72, atol=0.03)


def test_points_take_the_surface_of_the_map_s_entity(sequence, tmp_path):
    """Two points name one entity: it is shared. A point far from every entity finds nothing."""
    panoptic_map = write_map(
        tmp_path / "map", {5: box_mesh((-0.6, -0.4, 0), (0.6, 0.4, 0.72)).subdivide_to_size(0.02)}, {5: "table"}
    )
    document = copy.deepcopy(BY_BOXES)
    document["nodes"] = [
        {"name": "left", "class": "table", "find": {"point": [-0.6, 0, 0.5]}},
        {"name": "right", "class": "table", "find": {"point": [0.6, 0, 0.5]}},
        {"name": "nothing", "class": "cup", "find": {"point": [1.5, 1, 1.5]}},
    ]
    document["relations"] = [{"child": name, "parent": "scene"} for name in ("left", "right", "nothing")]
    truth = make(document, sequence, tmp_path, panoptic_map)
    points, owner = read_arrays(truth.path("visible.npz"), "points", "instance")
    assert set(owner.tolist()) == {0, 1, 2}
    assert (points[owner == 1, 0] < 0.01).all() and (points[owner == 2, 0] > -0.01).all()
    with pytest.raises(BadInput, match="takes a map"):
        make(document, sequence, tmp_path / "without")


def predicted_graph(truth: GroundTruth, folder: Path, parent_of_tray: str) -> ContactGraph:
    """The true graph without the thing that nobody saw, the tray on `parent_of_tray`."""
    links = [link for link in truth.graph.links if "far" not in (link.source, link.target)]
    links = [
        Relation(source=parent_of_tray, target="tray", relation="supports", confidence=1.0)
        if (link.target, link.relation) == ("tray", "supports")
        else link
        for link in links
    ]
    nodes = tuple(node for node in truth.graph.nodes if node.id != "far")
    folder.mkdir()
    ContactGraphFile(nodes=nodes, links=tuple(links)).write(folder / "graph.json")
    return ContactGraph(folder)


@pytest.mark.parametrize(("parent", "distance", "f1"), [("table", 0, 1.0), ("floor", 2, 2 / 3)])
def test_evaluate_scores_a_graph_against_the_annotation(sequence, tmp_path, parent, distance, f1):
    """The thing that no frame shows counts neither way; a wrong parent costs 2, as in a generated room."""
    truth = make(BY_BOXES, sequence, tmp_path)
    graph = predicted_graph(truth, tmp_path / "graph", parent)
    made = evaluate(
        ground_truth=truth,
        contact_graph=graph,
        parameters=EvaluateParameters(plots=False),
        context=context(tmp_path / "evaluation"),
    )
    metrics = json.loads((made.root / "metrics.json").read_text())["metrics"]
    assert metrics["graph/edit_distance"] == distance
    assert metrics["graph/wrong_supports"] == distance / 2
    assert metrics["graph/missing_detections"] == metrics["graph/wrong_detections"] == 0
    assert metrics["graph/supports_f1"] == pytest.approx(f1)
    assert metrics["graph/leans_on_f1"] == 1.0


def test_optional_things_are_neither_missed_nor_extra(sequence, tmp_path):
    document = with_node(2, optional=True)
    truth = make(document, sequence, tmp_path)
    whole = predicted_graph(truth, tmp_path / "graph", "table")
    without = ContactGraph(tmp_path / "without")
    without.root.mkdir()
    links = tuple(link for link in whole.info.links if link.target != "tray")
    nodes = tuple(node for node in whole.info.nodes if node.id != "tray")
    ContactGraphFile(nodes=nodes, links=links).write(without.root / "graph.json")
    for number, graph in enumerate((whole, without)):
        made = evaluate(
            ground_truth=truth,
            contact_graph=graph,
            parameters=EvaluateParameters(plots=False),
            context=context(tmp_path / f"evaluation{number}"),
        )
        metrics = json.loads((made.root / "metrics.json").read_text())["metrics"]
        assert metrics["graph/missing_detections"] == metrics["graph/wrong_detections"] == 0
        assert metrics["graph/supports_f1"] == 1.0


def changed(**top) -> dict:
    return {**copy.deepcopy(BY_BOXES), **top}


def with_relation(number: int, **keys) -> dict:
    document = copy.deepcopy(BY_BOXES)
    document["relations"][number].update(keys)
    return document


def with_node(number: int, **keys) -> dict:
    document = copy.deepcopy(BY_BOXES)
    document["nodes"][number].update(keys)
    return document


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (changed(version=2), "version"),
        (changed(format="other"), "format"),
        (changed(made={**MADE, "date": "yesterday"}), "made.date"),
        (changed(nodes=[]), "nodes"),
        (changed(relations=BY_BOXES["relations"][:1]), "nothing is said to carry tray"),
        (changed(extra=1), "extra"),
        (with_relation(0, parent="tray"), "by way of others"),
        (with_relation(0, parent="table"), "carry itself"),
        (with_relation(0, parent="nobody"), "no node nobody"),
        (with_relation(0, child="scene"), "no node scene"),
        (with_relation(1, child="table"), "child of two relations"),
        (with_relation(1, also=["table"]), "table is named twice"),
        (with_relation(1, relation="proximal"), "relations.1.relation"),
        (with_node(1, name="floor"), "node floor is there twice"),
        (with_node(1, name="scene"), "may not be called scene"),
        (with_node(1, name="../x"), "nodes.1.name"),
        (with_node(1, **{"class": "dragon"}), "class 'dragon'"),
        (with_node(1, find={}), "exactly one of labels, box and point"),
        (with_node(1, find={"box": BOX, "point": [0, 0, 0]}), "exactly one"),
        (with_node(1, find={"labels": [3]}), "one file takes one way"),
        (with_node(1, find={"labels": [0]}), "nodes.1.find.labels"),
        (with_node(1, find={"box": {"center": [0, 0, 0], "size": [1, 0, 1]}}), "nodes.1.find.box.size"),
        (with_node(1, find={"box": {"center": [0, 0, 1e9], "size": [1, 1, 1]}}), "nodes.1.find.box.center"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(tmp_path, document, message):
    with pytest.raises(BadInput, match=message) as raised:
        read_support_annotation(written(tmp_path, document))
    assert "annotation.json" in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b"null", b'{"format": "scenewright-supports"}'])
def test_files_that_are_no_annotation(tmp_path, content):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(BadInput, match="a.json"):
        read_support_annotation(tmp_path / "a.json")
    with pytest.raises(BadInput, match="file is missing"):
        read_support_annotation(tmp_path / "b.json")


def test_an_annotation_of_another_recording(sequence, tmp_path):
    elsewhere = [{"name": "cup", "class": "cup", "find": {"box": {"center": [50, 0, 0], "size": [1, 1, 1]}}}]
    document = changed(nodes=elsewhere, relations=[{"child": "cup", "parent": "scene"}])
    with pytest.raises(BadInput, match="is it this recording"):
        make(document, sequence, tmp_path)


@settings(max_examples=60, deadline=None)
@given(
    parents=st.lists(st.integers(-1, 5), min_size=6, max_size=6),
    also=st.lists(st.none() | st.integers(0, 5), min_size=6, max_size=6),
)
def test_circles_are_found_wherever_they_are(parents, also):
    """Against a second way: follow every chain of carriers for as many steps as there are nodes."""
    relations = [
        {
            "child": f"n{k}",
            "parent": "scene" if parent < 0 else f"n{parent}",
            "also": [] if second is None else [f"n{second}"],
        }
        for k, (parent, second) in enumerate(zip(parents, also, strict=True))
        if k not in (parent, second) and parent != second
    ]
    children = {relation["child"] for relation in relations}
    relations += [{"child": f"n{k}", "parent": "scene"} for k in range(6) if f"n{k}" not in children]
    carriers = {r["child"]: {r["parent"], *r.get("also", [])} - {"scene"} for r in relations}
    circular = False
    for name in carriers:
        reached = {name}
        for _ in range(7):
            reached = set().union(*(carriers[n] for n in reached)) if reached else set()
            circular |= name in reached
    nodes = [{"name": f"n{k}", "class": "box", "find": {"labels": [k + 1]}} for k in range(6)]
    told = SupportAnnotation.model_validate_json(json.dumps(changed(nodes=nodes, relations=relations)))
    problems = list(contradictions(told))
    assert any("by way of others" in problem for problem in problems) == circular
    assert circular or not problems


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(0, 4)), min_size=1, max_size=60))
def test_most_common_labels_against_counting(values):
    points = np.array([[0.01 * cell + 0.005, 0.0, 0.0] for cell, _ in values])
    labels = np.array([label for _, label in values])
    means, found = most_common_labels(points, labels)
    cells = sorted({cell for cell, _ in values})
    np.testing.assert_allclose(means[:, 0], [0.01 * cell + 0.005 for cell in cells])
    for cell, label in zip(cells, found, strict=True):
        own = [b for a, b in values if a == cell]
        assert own.count(label) == max(map(own.count, own)) and label == min(
            b for b in own if own.count(b) == own.count(label)
        )


def test_the_annotations_of_the_repository_can_be_read():
    files = sorted((Path(__file__).resolve().parents[3] / "data" / "annotations").glob("*/**/*.json"))
    painted = [path for path in files if path.parent.name == "painted"]
    assert len(files) - len(painted) >= 46 and len(painted) == 2
    told = {path: read_support_annotation(path) for path in files if path not in painted}
    for path in painted:
        nodes = told[path.parent.parent / path.name].nodes
        file = read_outlines(path, [node.name for node in nodes])
        drawn = {outline.name for frame in file.frames for outline in frame.outlines}
        assert {node.name for node in nodes if not node.optional} <= drawn

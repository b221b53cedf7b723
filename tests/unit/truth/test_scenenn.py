"""SceneNN's annotation becomes ground truth: what was written comes back, and broken files are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import EntitiesFile, Entity
from scenewright.schemas.sequence import Sequence
from scenewright.stages.evaluate.graph_measures import measure_boxes
from scenewright.stages.evaluate.map_measures import PredictedMap, label_true_points, measure_instances, measure_quality
from scenewright.stages.evaluate.parameters import EvaluateParameters
from scenewright.stages.evaluate.results import Part
from scenewright.stages.evaluate.stage import run as evaluate
from scenewright.stages.evaluate.surfaces import Surface
from scenewright.stages.evaluate.truth import load_truth
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.stage import run as ingest
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.scenenn_annotation import (
    AnnotatedLabel,
    class_by_last_word,
    class_by_substring,
    read_annotation,
)
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.truth.labelled_mesh import read_labelled_mesh
from scenewright.stages.truth.parameters import SceneNNParameters
from scenewright.stages.truth.stage import read_words, run
from scenewright.stages.truth.surface import surface_points

from tests.unit.truth.scenenn_folder import ROOM, SCENE, VOID, annotation, labelled_mesh, ply_bytes, write_folder


def context(folder: Path) -> Context:
    folder.mkdir(parents=True)
    return Context(output=folder, seed=0, device="cpu", progress=SilentProgress())


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    return write_folder(tmp_path_factory.mktemp("scenenn"))


@pytest.fixture(scope="module")
def sequence(scene, tmp_path_factory) -> Sequence:
    return ingest(scene, parameters=IngestParameters(), context=context(tmp_path_factory.mktemp("s") / "sequence"))


@pytest.fixture(scope="module")
def truth(scene, sequence, tmp_path_factory) -> GroundTruth:
    return make(scene, sequence, tmp_path_factory.mktemp("t") / "ground_truth")


def make(scene: Path, sequence: Sequence, out: Path, **parameters) -> GroundTruth:
    return run(
        scene / f"{SCENE}.xml",
        scene / f"{SCENE}.ply",
        sequence,
        parameters=SceneNNParameters(**parameters),
        context=context(out),
    )


def test_classes_and_instances_come_back(truth):
    file = truth.info
    assert file.source == "scan" and file.recipe == f"SceneNN {SCENE}"
    assert {o.instance: o.class_name for o in file.objects} == {
        thing.instance: thing.class_name for thing in ROOM if thing.instance not in VOID
    }
    points, instances = read_arrays(truth.path("visible.npz"), "points", "instance")
    assert len(points) == len(instances) > 10_000
    assert set(instances.tolist()) == {0} | {thing.instance for thing in ROOM} - VOID
    assert truth.graph.links == () and truth.graph.graph == {"annotated": "no"}


def test_boxes_stand_upright_in_the_sequence_s_world(truth, sequence):
    """The log's world is y up and leans by three degrees; ingest saw the floor."""
    assert sequence.info.gravity.method == "floor_plane"
    for thing in ROOM:
        if thing.instance in VOID or thing.class_name in ("floor", "wall"):
            continue
        box = next(o.box for o in truth.info.objects if o.instance == thing.instance)
        size = np.subtract(thing.high, thing.low)
        np.testing.assert_allclose(sorted(box.size[:2]), sorted(size[:2]), atol=0.02)
        assert box.size[2] == pytest.approx(size[2], abs=0.02)
        assert box.center[2] == pytest.approx(size[2] / 2, abs=0.02)  # the floor is z = 0


def test_the_annotation_evaluated_against_itself_is_perfect(truth):
    """A map that is the annotation, point by point: every figure of the tables is 1."""
    parameters = EvaluateParameters()
    room = load_truth(truth, np.eye(4), parameters.minimum_visible_points)
    entities = tuple(
        Entity(
            instance=entry.instance,
            class_name=entry.class_name,
            mesh="entities/1.ply",
            vertices=int((room.instances == entry.instance).sum()),
            triangles=1,
            box_minimum=(0, 0, 0),
            box_maximum=(1, 1, 1),
            confidence=1.0,
            observations=1,
            segments=(entry.instance,),
        )
        for entry in room.objects
    )
    info = EntitiesFile(
        voxel_size=0.01, truncation_distance=0.04, frames_integrated=1, segmentation="the annotation", entities=entities
    )
    predicted = PredictedMap(info, Surface(room.points, np.zeros((0, 3), np.int64)), room.instances)
    part = Part("map")
    labels = label_true_points(room, predicted, parameters.label_distance)
    measure_quality(part, room, predicted, labels, parameters)
    measure_instances(part, room, predicted, labels, parameters)
    measure_boxes(part, room, truth.graph, {}, parameters)
    for measure in (
        "pq",
        "sq",
        "rq",
        "pq_stuff",
        "pq_thing",
        "pq_thesis_code",
        "instance_ap50",
        "instance_ap50_thesis_code",
        "obb_ap50_observed",
        "obb_ap50_refined",
    ):
        assert part.metrics[f"map/{measure}"] == 1.0, measure
    assert part.metrics["map/classes"] == 5


def test_the_truth_is_not_moved_twice(truth, sequence, tmp_path):
    """It is in the sequence's world already: the move of that is not applied to it, and its path is not asked for."""
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    assert not np.allclose(world_from_log, np.eye(4))
    least = EvaluateParameters().minimum_visible_points
    still, given = load_truth(truth, np.eye(4), least), load_truth(truth, world_from_log, least)
    assert np.array_equal(still.points, given.points) and still.objects == given.objects
    made = evaluate(
        ground_truth=truth,
        sequence=sequence,
        parameters=EvaluateParameters(plots=False),
        context=context(tmp_path / "evaluation"),
    )
    assert made.outcome == "ok"


def test_points_cover_a_coarse_triangle_evenly():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points, labels = surface_points(vertices, np.array([[0, 1, 2]]), np.array([3, 4, 5]), 0.01)
    cells = {tuple(cell) for cell in np.floor(points.astype(float) / 0.01 + 1e-6).astype(int)}
    inside = {(x, y, 0) for x in range(100) for y in range(100) if x + y < 99}
    assert len(inside - cells) < 0.01 * len(inside)
    weights = np.column_stack([1 - points[:, 0] - points[:, 1], points[:, 0], points[:, 1]])
    clear = np.sort(weights, axis=1)[:, 2] - np.sort(weights, axis=1)[:, 1] > 1e-6
    assert (labels == weights.argmax(axis=1) + 3)[clear].all() and clear.mean() > 0.95


def test_the_thesis_s_words():
    words = read_words()
    expected = {"floor", "wall", "backpack", "chair", "table", "monitor", "bed", "fridge", "cabinet", "sofa"}
    assert set(words.values()) == expected

    def both(text: str, nyu: str = "") -> tuple[str | None, str | None]:
        label = AnnotatedLabel(1, text, nyu)
        return class_by_substring(label, words), class_by_last_word(label, words)

    assert both("desk") == ("table", "table")
    assert both("office chair3") == ("chair", "chair")
    assert both("table lamp") == ("table", None)
    assert both("", "sofa") == (None, "sofa")
    assert both("floor lamp") == ("floor", None)
    assert both("") == both("unknown") == (None, None)


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        (
            '<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;">]><annotation><label id="1" text="&c;"/></annotation>',
            "document type",
        ),
        ('<!DOCTYPE a SYSTEM "file:///etc/passwd"><annotation><label id="1" text="a"/></annotation>', "document type"),
        ('<annotation><label id="1" text="a"></annotation>', "well-formed"),
        ("<annotation/>", "no label"),
        ('<scene><label id="1"/></scene>', "<scene>"),
        ('<annotation><label id="one"/></annotation>', "'one'"),
        ('<annotation><label text="chair"/></annotation>', "label 1"),
        ('<annotation><label id="-3"/></annotation>', "-3"),
        ('<annotation><label id="99999999999999"/></annotation>', "not a label of a mesh"),
        ('<annotation><label id="3"/><label id="3"/></annotation>', "twice"),
        ("", "well-formed"),
    ],
)
def test_bad_annotations_are_told(tmp_path, xml, message):
    path = tmp_path / "011.xml"
    path.write_text(xml)
    with pytest.raises(BadInput, match=message):
        read_annotation(path)


def test_a_missing_annotation_is_told(tmp_path):
    with pytest.raises(BadInput, match="file is missing"):
        read_annotation(tmp_path / "011.xml")


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_are_an_annotation_or_bad_input(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("fuzz") / "a.xml"
    path.write_bytes(b"<annotation>" + data + b"</annotation>")
    try:
        read_annotation(path)
    except BadInput as error:
        assert str(path) in error.message


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 600), st.integers(0, 255))
def test_a_broken_mesh_is_bad_input_or_read(tmp_path_factory, place, value):
    data = bytearray(ply_bytes(np.eye(4)[:, :3], np.array([[0, 1, 2], [1, 2, 3]]), np.array([7, 7, 8, 8])))
    data[place % len(data)] = value
    path = tmp_path_factory.mktemp("fuzz") / "a.ply"
    path.write_bytes(bytes(data))
    try:
        read_labelled_mesh(path)
    except BadInput as error:
        assert str(path) in error.message


def test_text_and_binary_meshes_are_read_alike(tmp_path):
    vertices, faces, labels = labelled_mesh()
    for name, text in (("a.ply", True), ("b.ply", False)):
        (tmp_path / name).write_bytes(ply_bytes(vertices, faces, labels, text=text))
    one, two = read_labelled_mesh(tmp_path / "a.ply"), read_labelled_mesh(tmp_path / "b.ply")
    np.testing.assert_allclose(one.vertices, two.vertices, atol=1e-6)
    np.testing.assert_array_equal(one.labels, two.labels)
    np.testing.assert_array_equal(one.labels, labels)


def test_bad_meshes_are_told(tmp_path):
    path = tmp_path / "011.ply"
    whole = ply_bytes(*labelled_mesh())
    for data, message in (
        (whole[: len(whole) // 2], str(path)),
        (whole.replace(b"element vertex ", b"element vertex 9"), "011.ply"),
        (whole.replace(b"property uint label", b"property uint banel"), "no property `label`"),
        (b"ply\n", "no PLY header"),
    ):
        path.write_bytes(data)
        with pytest.raises(BadInput, match=message):
            read_labelled_mesh(path)
    (tmp_path / "a.obj").write_text("v 0 0 0\n")
    with pytest.raises(BadInput, match="no PLY"):
        read_labelled_mesh(tmp_path / "a.obj")


def test_a_mesh_without_label_but_colours_is_told(tmp_path, scene):
    mesh = read_mesh(scene / f"{SCENE}.ply")
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "011.ply")
    with pytest.raises(BadInput, match="no property `label`"):
        read_labelled_mesh(tmp_path / "011.ply")


def test_labels_that_the_annotation_does_not_list(tmp_path, scene, sequence):
    """A few are void and counted; many mean that the files do not belong together."""
    texts = {8844: "desk", 5: "floor"}
    (tmp_path / f"{SCENE}.xml").write_text(annotation(texts))
    (tmp_path / f"{SCENE}.ply").write_bytes((scene / f"{SCENE}.ply").read_bytes())
    with pytest.raises(BadInput, match="does not list, the first is 17"):
        make(tmp_path, sequence, tmp_path / "one")
    made = make(tmp_path, sequence, tmp_path / "two", maximum_unlisted=1.0)
    assert made.summary["unlisted_vertices"] > 0
    assert {o.class_name for o in made.info.objects} == {"floor", "table"}
    (tmp_path / f"{SCENE}.xml").write_text(annotation({1000: "chair"}))
    with pytest.raises(BadInput, match="none of the 2 labels"):
        make(tmp_path, sequence, tmp_path / "three")


def test_an_annotation_without_any_of_the_classes_is_told(tmp_path, scene, sequence):
    (tmp_path / f"{SCENE}.xml").write_text(annotation({thing.instance: "thing" for thing in ROOM}))
    (tmp_path / f"{SCENE}.ply").write_bytes((scene / f"{SCENE}.ply").read_bytes())
    with pytest.raises(BadInput, match="no label with a surface"):
        make(tmp_path, sequence, tmp_path / "one")


def test_the_same_files_give_the_same_bytes(truth, scene, sequence, tmp_path):
    again = make(scene, sequence, tmp_path / "again")
    for name in ("ground_truth.json", "graph.json", "mesh.ply", "visible.npz"):
        assert again.path(name).read_bytes() == truth.path(name).read_bytes()

"""The Python API: every kind opens as what it is, lazily, and nothing is ever written."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import networkx
import numpy as np
import pytest

from scenewright import LoadedArtifact, load, load_run
from schemas.errors import BadInput
from schemas.kinds import KINDS
from schemas.manifest import MANIFEST_NAME
from stages.engine.loading import LoadedContactGraph, LoadedMap, LoadedSequence
from stages.engine.loading.opening import CLASSES
from stages.kit.formats.frames import FrameReader
from tests.unit.housekeeping.artifacts import snapshot
from tests.unit.housekeeping.tiny_run import make_tiny_run
from tests.unit.ingest.tiny_room import CAMERA, camera_poses

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_tiny_run(tmp_path_factory.mktemp("runs") / "tiny")


@pytest.fixture(scope="module")
def run(run_folder: Path) -> dict:
    return load_run(run_folder)


def test_every_kind_has_a_class_and_opens_as_it(run: dict) -> None:
    made = set(KINDS) - {"trajectory"} - {kind for kind in KINDS if kind.startswith("test_")}
    assert set(CLASSES) == made
    assert {type(artifact) for artifact in run.values()} == {*CLASSES.values(), LoadedArtifact}
    for name, artifact in run.items():
        assert artifact.path.name == name and artifact.kind in repr(artifact)
        assert artifact.kind == json.loads((artifact.path / MANIFEST_NAME).read_text())["kind"]


def test_opening_reads_no_payload(run_folder: Path, tmp_path: Path) -> None:
    """What is wrong inside shows when it is asked for, as bad input."""
    shutil.copytree(run_folder / "evaluation", tmp_path / "evaluation")
    payload = tmp_path / "evaluation" / "metrics.json"
    payload.write_text("?" * payload.stat().st_size)
    loaded = load(tmp_path / "evaluation")
    with pytest.raises(BadInput, match="metrics.json"):
        loaded.metrics  # noqa: B018
    payload.write_text("?")
    with pytest.raises(BadInput, match="the manifest says"):
        load(tmp_path / "evaluation")


def test_using_writes_nothing(run_folder: Path) -> None:
    before = snapshot(run_folder)
    for artifact in load_run(run_folder).values():
        for name in dir(artifact):
            if not name.startswith("_"):
                getattr(artifact, name)
    assert snapshot(run_folder) == before


def test_sequence(run: dict, run_folder: Path) -> None:
    sequence = run["sequence"]
    assert len(sequence) == 5 and sequence.camera == CAMERA and list(sequence.cameras) == ["camera"]
    with FrameReader(run_folder / "sequence" / "frames.mcap") as reader:
        np.testing.assert_array_equal(sequence.times, reader.times)
        indices, poses = reader.poses()
        np.testing.assert_allclose(sequence.poses, poses, atol=1e-8)
        assert len(indices) == len(sequence.poses) == 5
    assert [frame.index for frame in sequence.frames(("depth",), every=2)] == [0, 2, 4]
    frame = sequence.frame(3)
    assert frame.color.shape == (CAMERA.height, CAMERA.width, 3) and frame.depth.dtype == np.float32
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    np.testing.assert_allclose(frame.world_from_camera, world_from_log @ camera_poses(5)[3], atol=1e-8)


def test_segments_and_map(run: dict) -> None:
    segments, found = run["segments"], run["panoptic_map"]
    mask = segments.mask(2)
    assert {segment.id for segment in segments.segments(2)} == set(np.unique(mask)) - {0}
    assert segments.frame_indices == (0, 1, 2, 3, 4) and segments.label == "test masks"
    with pytest.raises(KeyError):
        segments.segments(9)
    entity = found.entities[0]
    assert (entity.instance, entity.class_name) == (4, "table")
    np.testing.assert_allclose(entity.box, entity.mesh.bounds)
    assert found.mesh.volume == pytest.approx(1) and entity.mesh.visual.vertex_colors[0].tolist() == [10, 20, 30, 255]
    assert {len(labels) for labels in found.vertex_labels.values()} == {len(found.mesh.vertices)}


def test_graphs(run: dict) -> None:
    for name in ("contact_graph", "cad_scene", "interactive_scene", "ground_truth"):
        artifact = run[name]
        document = json.loads((artifact.path / "graph.json").read_text())
        expected = networkx.node_link_graph(document, edges="links")
        graph = artifact.graph
        assert set(graph.nodes) == set(expected.nodes) and graph.number_of_edges() == expected.number_of_edges()
        assert sorted(graph.edges(data="relation")) == sorted(expected.edges(data="relation"))
        support = [(u, v) for u, v, relation in graph.edges(data="relation") if relation != "proximal"]
        assert networkx.is_arborescence(networkx.DiGraph(support))
        assert graph.nodes["table_3"]["class_name"] == "table"
    contact = run["contact_graph"]
    assert contact.parent("scene") is None
    assert all(contact.parent(child) == "table_3" for child in contact.children("table_3"))


def test_scenes(run: dict) -> None:
    scene, library = run["interactive_scene"], run["cad_library"]
    for path in (scene.urdf_path, scene.static_urdf_path, library.urdf_path("table_00")):
        assert ElementTree.parse(path).getroot().tag == "robot"
    assert scene.mjcf_path.exists() and {body.name for body in scene.bodies} >= {"table_3", "cup_5"}
    assert scene.world_from_body("table_3").shape == (4, 4)
    with pytest.raises(KeyError):
        scene.world_from_body("nonsense")
    with pytest.raises(BadInput, match="no file"):
        library.urdf_path("../../secret")
    assert run["cad_scene"].replacements["table_3"].chosen.model_id in library.models
    assert {item.name for item in run["ground_truth"].objects} >= {"table_3"}


def test_results(run: dict) -> None:
    packing = run["packing"]
    assert packing.success and len(packing.attempts) == 2 and packing.problem.boxes[0].name == "red"
    assert {name: len(rows) for name, rows in packing.trajectory.items()} == {"joints": 3, "action": 3}
    plan = run["plan"]
    assert plan.status == "executed" and [action.name for action in plan.actions] == ["pick"] and plan.failures == ()
    assert {name: len(rows) for name, rows in plan.trajectory.items()} == dict.fromkeys(
        ("time", "joints", "world_from_base", "action"), 4
    )
    assert run["evaluation"].metrics == {"map/pq": 0.5, "map/ap": None} and run["evaluation"].label == "test"
    assert run["report"].html_path.read_text() == "<html></html>"
    assert run["exported_sequence"].info.layout == "tum" and (run["exported_sequence"].log / "rgb.txt").exists()


def test_what_cannot_be_opened_says_what_to_do(run_folder: Path, tmp_path: Path) -> None:
    assert load(run_folder / "panoptic_map", LoadedMap).entities
    with pytest.raises(BadInput, match="'sequence' is needed"):
        load(run_folder / "panoptic_map", LoadedSequence)
    assert isinstance(load(str(run_folder / "contact_graph")), LoadedContactGraph)
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(BadInput):
            load(path)
        with pytest.raises(BadInput):
            load_run(path)
    with pytest.raises(BadInput, match="scenewright migrate"):
        load(REPOSITORY / "tests" / "golden" / "v1" / "sequence")
    with pytest.raises(BadInput, match="has no file"):
        load(run_folder / "sequence").file("../../etc/passwd")


def test_the_module_stands_on_kit_and_engine_only() -> None:
    """The import graph is of packages; scenewright.py is a single file, so this is checked here."""
    tree = ast.parse((REPOSITORY / "scenewright.py").read_text())
    names = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert names and all(
        name.split(".")[0] == "schemas" or name.startswith(("stages.kit.", "stages.engine.")) for name in names
    )
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    for top in ("cli", "stages", "schemas"):
        for path in (REPOSITORY / top).rglob("*.py"):
            assert "scenewright import" not in path.read_text(), f"{path}: the API is for others"


def notebook_cells() -> list[str]:
    document = json.loads((REPOSITORY / "docs" / "notebook.ipynb").read_text())
    return ["".join(cell["source"]) for cell in document["cells"] if cell["cell_type"] == "code"]


def test_the_notebook_is_whole_and_carries_no_outputs() -> None:
    nbformat = pytest.importorskip("nbformat")
    nbformat.validate(nbformat.read(REPOSITORY / "docs" / "notebook.ipynb", as_version=4))
    document = json.loads((REPOSITORY / "docs" / "notebook.ipynb").read_text())
    code = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


def test_the_notebook_runs(run_folder: Path, tmp_path: Path) -> None:
    script = tmp_path / "notebook.py"
    script.write_text("\n\n".join(notebook_cells()))
    environment = {
        **os.environ, "SCENEWRIGHT_RUN": str(run_folder), "MPLBACKEND": "Agg", "PYTHONPATH": str(REPOSITORY),
    }  # fmt: skip
    done = subprocess.run([sys.executable, script], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "panoptic_map" in done.stdout and "map/pq" in done.stdout


def test_examples_of_the_docs_run(run_folder: Path, tmp_path: Path) -> None:
    """Every python block of docs/PYTHON.md, in order, on the tiny run."""
    text = (REPOSITORY / "docs" / "PYTHON.md").read_text()
    blocks = [part.split("```")[0] for part in text.split("```python\n")[1:]]
    assert len(blocks) >= 5
    (tmp_path / "outputs").mkdir()
    (tmp_path / "outputs" / "demo").symlink_to(run_folder)
    script = tmp_path / "examples.py"
    script.write_text("\n".join(blocks))
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run([sys.executable, script], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

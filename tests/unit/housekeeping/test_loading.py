"""The Python API: every kind opens as what it is, lazily, and nothing is ever written."""

from __future__ import annotations

import ast
import contextlib
import inspect
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import networkx
import numpy as np
import pytest
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import FrameReader

from scenewright import as_networkx, as_tables, load, load_run, payload
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


GOLDEN = [
    path
    for path in sorted((REPOSITORY / "tests" / "golden").glob("v*/*"))
    if path.parent.name == f"v{KINDS[path.name].schema_version}"
]


@pytest.mark.parametrize("root", GOLDEN, ids=lambda path: path.name)
def test_every_kind_opens_as_the_handle_that_steps_get(root: Path) -> None:
    artifact = load(root)
    assert type(artifact) is KINDS[root.name] and repr(artifact).startswith(f"<{root.name} ")
    main = inspect.getattr_static(type(artifact), "info")
    assert main.name in artifact.json_files | artifact.optional_json_files
    assert type(artifact.info) is (main.model if (root / main.name).exists() else type(None)), "the main document"
    assert artifact.info is artifact.info, "parsed once"


def test_a_run_is_opened_by_step(run: dict) -> None:
    for name, artifact in run.items():
        assert artifact.root.name == name
        assert artifact.kind == json.loads((artifact.root / MANIFEST_NAME).read_text())["kind"]


def test_opening_reads_no_payload(run_folder: Path, tmp_path: Path) -> None:
    """What is wrong inside shows when it is asked for, as bad input."""
    shutil.copytree(run_folder / "evaluation", tmp_path / "evaluation")
    document = tmp_path / "evaluation" / "metrics.json"
    document.write_text("?" * document.stat().st_size)
    loaded = load(tmp_path / "evaluation")
    with pytest.raises(BadInput, match="metrics.json"):
        loaded.info  # noqa: B018
    document.write_text("?")
    with pytest.raises(BadInput, match="the manifest says"):
        load(tmp_path / "evaluation")


def test_using_writes_nothing(run_folder: Path) -> None:
    before = snapshot(run_folder)
    for artifact in load_run(run_folder).values():
        for name in dir(artifact):
            if not name.startswith("_"):
                getattr(artifact, name)
        for name in artifact.files:
            with contextlib.suppress(BadInput):
                payload(artifact, name)
    assert snapshot(run_folder) == before


def test_sequence(run: dict, run_folder: Path) -> None:
    sequence = run["sequence"]
    assert sequence.info.frame_count == 5 and sequence.info.camera == CAMERA
    with payload(sequence, "frames.mcap") as frames, FrameReader(run_folder / "sequence" / "frames.mcap") as reader:
        np.testing.assert_array_equal(frames.times, reader.times)
        assert [frame.index for frame in frames.frames(("depth",), every=2)] == [0, 2, 4]
        frame = frames.read(3)
        assert frame.color.shape == (CAMERA.height, CAMERA.width, 3) and frame.depth.dtype == np.float32
        _, poses = reader.poses()
        np.testing.assert_allclose(payload(sequence, "trajectory.tum")[1], poses, atol=1e-8)
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    np.testing.assert_allclose(frame.world_from_camera, world_from_log @ camera_poses(5)[3], atol=1e-8)


def test_disparity_is_a_sequence_too(run: dict) -> None:
    artifact = run["disparity"]
    with payload(artifact, "frames.mcap") as frames, payload(artifact, "disparity.mcap") as maps:
        found = maps.read(int(frames.stamps[0]))
        assert found.disparity.shape == (frames.camera.height, frames.camera.width)
    assert artifact.info.frame_count == len(artifact.matching.frames)


def test_segments_and_map(run: dict) -> None:
    segments, found = run["segments"], run["panoptic_map"]
    with payload(segments, "panoptic.zip") as masks:
        assert {segment.id for segment in segments.info.frames[2].segments} == set(np.unique(masks.read(2))) - {0}
    assert segments.info.label == "test masks"
    entity = found.info.entities[0]
    assert (entity.instance, entity.class_name) == (4, "table")
    mesh = payload(found, entity.mesh)
    np.testing.assert_allclose((entity.box_minimum, entity.box_maximum), mesh.bounds)
    whole, labels = payload(found, "mesh.ply"), payload(found, "mesh_labels.npz")
    assert whole.volume == pytest.approx(1) and mesh.visual.vertex_colors[0].tolist() == [10, 20, 30, 255]
    assert set(labels) == {"instance", "segment", "class_id"}
    assert {len(values) for values in labels.values()} == {len(whole.vertices)}


def test_graphs(run: dict) -> None:
    for name in ("contact_graph", "cad_scene", "interactive_scene", "ground_truth"):
        artifact = run[name]
        file = artifact.info if name == "contact_graph" else artifact.graph
        expected = networkx.node_link_graph(json.loads((artifact.root / "graph.json").read_text()), edges="links")
        graph = as_networkx(file)
        assert set(graph.nodes) == set(expected.nodes) and graph.number_of_edges() == expected.number_of_edges()
        assert sorted(graph.edges(data="relation")) == sorted(expected.edges(data="relation"))
        support = [(u, v) for u, v, relation in graph.edges(data="relation") if relation != "proximal"]
        assert networkx.is_arborescence(networkx.DiGraph(support))
        assert graph.nodes["table_3"]["class_name"] == "table"


def test_files_are_those_of_the_manifest(run: dict) -> None:
    scene, library = run["interactive_scene"], run["cad_library"]
    paths = [scene.file(scene.info.combined_file), scene.file(scene.info.static_file)]
    for path in (*paths, library.file("models/table_00/model.urdf")):
        assert ElementTree.parse(path).getroot().tag == "robot"
    with pytest.raises(BadInput, match="no file"):
        library.file("../../secret")
    with pytest.raises(BadInput, match="no file"):
        payload(library, "../../secret.ply")
    with pytest.raises(BadInput, match="no reader"):
        payload(scene, scene.info.combined_file)


def test_arrays(run: dict) -> None:
    rows = {name: len(values) for name, values in payload(run["plan"], "trajectory.npz").items()}
    assert rows == dict.fromkeys(("time", "joints", "world_from_base", "action"), 4)
    assert set(payload(run["packing"], "trajectory.npz")) == {"joints", "action"}


@pytest.mark.parametrize("root", GOLDEN, ids=lambda path: path.name)
def test_every_list_of_every_kind_is_a_table(root: Path) -> None:
    """No cell holds a record: those are tables or columns of their own."""
    pytest.importorskip("pandas")
    artifact = load(root)
    for name, table in as_tables(artifact).items():
        assert table.columns.is_unique, name
        for column in table.columns:
            for cell in table[column]:
                assert not isinstance(cell, Model), f"{name}: {column}"
                assert not (isinstance(cell, tuple) and any(isinstance(entry, Model) for entry in cell)), name
            if any(other.startswith(f"{column}.") for other in table.columns):
                assert table[column].notna().any(), (
                    f"{name}: {column} is empty, what it holds stands in columns of its own"
                )


def test_tables_say_what_the_documents_say(run: dict) -> None:
    pandas = pytest.importorskip("pandas")
    found = run["panoptic_map"]
    entities = as_tables(found)["entities"]
    assert entities["class_name"].tolist() == [entity.class_name for entity in found.info.entities]
    lowest = [entity.box_minimum[2] for entity in found.info.entities]
    assert entities["box_minimum.z"].tolist() == lowest
    rows = as_tables(run["segments"])["frames.segments"]
    expected = [(frame.frame, entry.id) for frame in run["segments"].info.frames for entry in frame.segments]
    assert list(zip(rows["frames.frame"], rows["id"], strict=True)) == expected
    metrics = as_tables(run["evaluation"])["metrics"].set_index("name")["value"]
    told = {name: None if pandas.isna(value) else value for name, value in metrics.items()}
    assert told == run["evaluation"].info.metrics
    graph = as_tables(run["cad_scene"])
    assert len(graph["nodes"]) == len(run["cad_scene"].graph.nodes)
    assert set(graph["links"]["relation"]) == {link.relation for link in run["cad_scene"].graph.links}


def test_a_list_that_is_empty_is_an_empty_table(run_folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    empty = PanopticMap(tmp_path)
    load(run_folder / "panoptic_map", PanopticMap).info.model_copy(update={"entities": ()}).write(
        tmp_path / "entities.json"
    )
    assert len(as_tables(empty)["entities"]) == 0


def test_a_machine_without_pandas_is_told(run: dict, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingDependency, match="notebooks"):
        as_tables(run["panoptic_map"])


@pytest.mark.slow
def test_type_checkers_know_what_is_loaded(run_folder: Path, tmp_path: Path) -> None:
    """As a user's mypy sees an installed copy: nothing but what the wheel holds, and py.typed."""
    wheel = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "--no-build-isolation",
        "-q",
        "-w",
        tmp_path,
        REPOSITORY,
    ]
    subprocess.run(wheel, check=True, capture_output=True)
    (built,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(built) as archive:
        assert "scenewright/py.typed" in archive.namelist()
    install = [sys.executable, "-m", "pip", "install", "--no-deps", "-q", "--target", tmp_path / "installed", built]
    subprocess.run(install, check=True, capture_output=True)
    script = tmp_path / "user.py"
    script.write_text(
        "from scenewright import as_networkx, as_tables, load, payload\n"
        "from scenewright.schemas.panoptic_map import PanopticMap\n"
        "found = load('map', PanopticMap)\n"
        "reveal_type(found.info.entities[0].box_minimum)\n"
        "reveal_type(payload(found, 'panoptic.zip').read(3))\n"
        "load(3)\n"
    )
    command = [sys.executable, "-m", "mypy", "--config-file=", "--ignore-missing-imports", str(script)]
    settings = {**os.environ, "MYPYPATH": str(tmp_path / "installed")}
    done = subprocess.run(command, cwd=tmp_path, env=settings, capture_output=True, text=True)
    assert 'Revealed type is "tuple[float, float, float]"' in done.stdout.replace("builtins.", "")
    assert "ndarray" in done.stdout and 'incompatible type "int"' in done.stdout


def test_what_cannot_be_opened_says_what_to_do(run_folder: Path, tmp_path: Path) -> None:
    assert load(run_folder / "panoptic_map", PanopticMap).info.entities
    assert isinstance(load(run_folder / "disparity", Sequence), Sequence)
    with pytest.raises(BadInput, match="'sequence' is needed"):
        load(run_folder / "panoptic_map", Sequence)
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(BadInput):
            load(path)
        with pytest.raises(BadInput):
            load_run(path)
    with pytest.raises(BadInput, match="scenewright migrate"):
        load(REPOSITORY / "tests" / "golden" / "v1" / "sequence")


def test_the_module_stands_on_kit_and_engine_only() -> None:
    """It belongs to no floor of the import graph, so this is checked here."""
    tree = ast.parse((REPOSITORY / "scenewright" / "__init__.py").read_text())
    others = ("__future__", "pathlib", "typing")
    names = [n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module not in others]
    assert names and all(
        name.startswith(("scenewright.schemas.", "scenewright.stages.kit.", "scenewright.stages.engine."))
        for name in names
    )
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    for top in ("cli", "stages", "schemas"):
        for path in (REPOSITORY / top).rglob("*.py"):
            assert "from scenewright import" not in path.read_text(), f"{path}: the API is for others"


NOTEBOOKS = sorted((REPOSITORY / "docs" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_whole_and_carry_no_outputs(path: Path) -> None:
    """tests/pipeline/test_small_chain.py executes them."""
    nbformat = pytest.importorskip("nbformat")
    nbformat.validate(nbformat.read(path, as_version=4))
    code = [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
    assert code and all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.parametrize(("page", "least"), [("EDIT.md", 5), ("LIBRARY.md", 1)])
def test_examples_of_the_docs_run(page: str, least: int, run_folder: Path, tmp_path: Path) -> None:
    """Every python block of the page, in order, on the tiny run."""
    text = (REPOSITORY / "docs" / page).read_text()
    blocks = [part.split("```")[0] for part in text.split("```python\n")[1:]]
    assert len(blocks) >= least
    (tmp_path / "outputs").mkdir()
    for name in ("demo", "room"):
        (tmp_path / "outputs" / name).symlink_to(run_folder)
    script = tmp_path / "examples.py"
    script.write_text("\n".join(blocks))
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run([sys.executable, script], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

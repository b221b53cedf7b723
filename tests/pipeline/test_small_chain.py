"""The whole chain on a small generated room: end to end, twice the same bytes, by make and by `scenewright run`."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline, resolve_variables, step_arguments
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.engine.verification import verify

from tests.contract.test_command_line import scenewright
from tests.reliability.kill_chain import SIGNALS, run_trial

REPOSITORY = Path(__file__).resolve().parents[2]
SMALL = {"frames": "24", "width": "240", "height": "180", "voxel_size": "0.04", "seed": "6", "shapes": "2"}
PIPELINE = read_pipeline(pipeline_path("demo"))
ACCEPTED = ("--accept", "unsettled", "--accept", "execution_failed")
"""What a room of 24 tiny frames may come to; a run ends with its gravest outcome."""
STEPS = [step.name for step in PIPELINE.step]


def manifest(folder: Path):
    found = open_artifact(folder).manifest
    assert found is not None
    return found


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "small"
    settings = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]
    done = scenewright("run", "demo", "--out", folder, *settings, "--json", *ACCEPTED)
    assert done.returncode == 0, done.stderr
    assert [step["status"] for step in json.loads(done.stdout)["steps"]] == ["made"] * len(STEPS)
    return folder


def arguments_of(step_name: str, folder: Path, out: Path | None = None) -> list[str]:
    step = next(step for step in PIPELINE.step if step.name == step_name)
    words = step_arguments(step, str(folder), resolve_variables(PIPELINE, SMALL))
    return words if out is None else [*words[:-1], str(out)]


def test_everything_verifies_back_to_the_log(run_folder: Path) -> None:
    findings = verify(run_folder / "report")
    assert {finding.path.name for finding in findings} == set(STEPS)
    for finding in findings:
        assert finding.problems == () and finding.notes == ()


def test_the_map_and_the_graph_are_about_the_room(run_folder: Path) -> None:
    metrics = json.loads((run_folder / "evaluation" / "metrics.json").read_text())
    assert "corruption 0.2" in metrics["label"]
    assert metrics["metrics"]["map/pq"] > 0.3
    baseline = json.loads((run_folder / "geometric_evaluation" / "metrics.json").read_text())
    assert metrics["metrics"]["map/pq_class_agnostic"] > baseline["metrics"]["map/pq_class_agnostic"]
    graph = json.loads((run_folder / "contact_graph" / "graph.json").read_text())
    classes = {node["id"]: node["class_name"] for node in graph["nodes"]}
    assert {"scene", "floor", "wall"} <= set(classes.values()) and len(classes) > 8
    parents = {link["target"]: link["source"] for link in graph["links"] if link["relation"] != "proximal"}
    assert set(parents) == set(classes) - {"scene"}
    html = (run_folder / "report" / "report.html").read_text()
    assert "corruption 0.2" in html
    # Its page in three dimensions loads nothing by its own policy, and names addresses in comments of its library.
    around = re.sub(r'srcdoc="[^"]*"', "", html)
    assert "http://" not in around and "https://" not in around


NOTEBOOKS = sorted((REPOSITORY / "docs" / "notebooks").glob("*.ipynb"))
SAID = {
    "compare_mappings": (r"corruption 0\.2", r"map/pq", r"parameter merging: ours -> thesis"),
    "own_backend": (r"--hues\b", r"\b6 hues: [1-9]\d* masks in 24 frames", r"12 hues: [1-9]\d* masks in 24 frames"),
    "own_log": (r"<sequence ", r"(?m)^    floor_", r"(?m)^        table_", r"scene\.urdf", r"movable"),
}
"""What each of them says of the small room."""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.slow
def test_notebooks_run(path: Path, run_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each on the small room, in a kernel, as a reader would; what they call is this checkout."""
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    pytest.importorskip("pandas")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    settings = {
        "PYTHONPATH": REPOSITORY,
        "SCENEWRIGHT_RUN": run_folder,
        "LOG": run_folder / "ground_truth" / "log.mcap",
        "OUT": tmp_path / "out",
    }
    for name, value in settings.items():
        monkeypatch.setenv(name, str(value))
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    pictures = [
        output
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]
    assert pictures, "every notebook shows something"
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    told = "".join(  # streams come in pieces
        output["text"] if "text" in output else f"\n{output.get('data', {}).get('text/plain', '')}\n"
        for output in outputs
    )
    assert [words for words in SAID[path.stem] if not re.search(words, told)] == [], told


def test_a_second_run_has_nothing_to_do(run_folder: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in run_folder.rglob("*")}
    settings = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]
    done = scenewright("run", "demo", "--out", run_folder, *settings, "--json", *ACCEPTED)
    assert done.returncode == 0, done.stderr
    assert [step["status"] for step in json.loads(done.stdout)["steps"]] == ["up to date"] * len(STEPS)
    assert {path: path.stat().st_mtime_ns for path in run_folder.rglob("*")} == before


def test_make_gives_identical_digests_and_rebuilds_what_is_deleted(run_folder: Path, tmp_path: Path) -> None:
    """make starts from a copy without the middle of the chain, builds that, and ends with the same digests."""
    folder = tmp_path / "outputs" / "demo"
    shutil.copytree(run_folder, folder)
    shutil.rmtree(folder / "contact_graph")
    command = ["make", "-f", "data/pipelines/demo.mk", f"PYTHON={sys.executable}", f"OUTPUTS={tmp_path}/outputs"]
    command += [f"{name.upper()}={value}" for name, value in SMALL.items()]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "graph: made" in done.stderr
    for name in STEPS:
        assert manifest(folder / name).content_digest == manifest(run_folder / name).content_digest, name
        assert manifest(folder / name).key == manifest(run_folder / name).key, name


@pytest.mark.slow
@pytest.mark.parametrize("name", STEPS)
def test_same_seed_same_bytes(run_folder: Path, tmp_path: Path, name: str) -> None:
    """Every step made once more, elsewhere and on one thread, gives the same content digest."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "PYTHONHASHSEED": "7"}
    done = scenewright(*arguments_of(name, run_folder, tmp_path / name), "--quiet", env=environment)
    assert done.returncode == 0, done.stderr
    first, again = manifest(run_folder / name), manifest(tmp_path / name)
    if first.content_digest != again.content_digest:
        pairs = {record.path: record.sha256 for record in first.files if record.digested}
        pytest.fail(f"other bytes in {[r.path for r in again.files if r.digested and pairs.get(r.path) != r.sha256]}")


@pytest.mark.parametrize("name", STEPS)
@pytest.mark.slow
def test_kill_leaves_the_previous_artifact(run_folder: Path, tmp_path: Path, name: str) -> None:
    """SIGKILL while a step works on an existing artifact: the old one stays, sound, and nothing half-made shows."""
    out = tmp_path / name
    shutil.copytree(run_folder / name, out)
    took = manifest(out).provenance.seconds
    process = subprocess.Popen(
        [sys.executable, "-m", "scenewright", *arguments_of(name, run_folder, out), "--force", "--quiet"],
        cwd=REPOSITORY,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while not list(tmp_path.glob(f".{name}.partial-*")) and process.poll() is None:
        time.sleep(0.002)
    time.sleep(random.Random(name).uniform(0.0, min(took, 2.0)))
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    found = manifest(out)
    assert content_digest(record_files(out, type(open_artifact(out)).undigested)) == found.content_digest
    assert found.content_digest == manifest(run_folder / name).content_digest


FAST = ("sequence", "geometric_segments", "geometric_map", "contact_graph")


@pytest.mark.parametrize("number", range(12))
@pytest.mark.slow
def test_interrupted_steps_resume_to_the_same_digest(run_folder: Path, tmp_path: Path, number: int) -> None:
    """A dozen interruptions as in docs/RELIABILITY.md: SIGKILL, SIGINT, SIGTERM, early and as the artifact is whole."""
    rng = random.Random(number)
    name, how, late = FAST[number % 4], SIGNALS[number % 3], number >= 8
    seconds = manifest(run_folder / name).provenance.seconds + 1.0
    moment = 1 + rng.random() if late else rng.random()
    atomic = number % 4 != 3
    trial = run_trial(name, run_folder, tmp_path / "trial", seconds, moment, how, number % 2 == 0, atomic, SMALL)
    assert trial.problems == (), trial

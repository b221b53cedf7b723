"""Pipelines: checked before anything runs; make and `scenewright run` execute the same commands."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path

import pytest
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.stages.engine.batch import read_batch, worst_exit_code
from scenewright.stages.engine.chain import StepReport, run_pipeline
from scenewright.stages.engine.given_inputs import check_given_inputs
from scenewright.stages.engine.make_rules import makefile_for
from scenewright.stages.engine.pipelines import (
    PIPELINES_FOLDER,
    pipeline_path,
    read_pipeline,
    resolve_variables,
    step_arguments,
)

REPOSITORY = Path(__file__).resolve().parents[2]
NAMES = sorted(path.stem for path in PIPELINES_FOLDER.glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_generated_makefiles_are_current(name: str) -> None:
    text = makefile_for(read_pipeline(pipeline_path(name)))
    assert (PIPELINES_FOLDER / f"{name}.mk").read_text() == text, "stale: make rules"


@pytest.mark.parametrize("name", NAMES)
def test_make_runs_the_same_commands_in_the_same_order(name: str, tmp_path: Path) -> None:
    """`make -n` prints exactly what `scenewright run` would execute."""
    pipeline = read_pipeline(pipeline_path(name))
    given = {
        variable: "value"
        for variable, declared in pipeline.variables.items()
        if declared.default is None and not declared.optional
    }
    recording = tmp_path / "room"
    recording.write_text("x")
    given |= {variable: str(recording) for variable in ("log", "scan") if variable in given}
    values = resolve_variables(pipeline, given)
    expected = [step_arguments(step, f"{tmp_path}/outputs/run", values) for step in pipeline.step]
    done = subprocess.run(
        ["make", "-n", "-f", f"data/pipelines/{name}.mk", "PYTHON=python", f"OUTPUTS={tmp_path}/outputs", "RUN=run"]
        + [f"{variable.upper()}={value}" for variable, value in given.items()],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
    )
    commands = [shlex.split(line)[3:] for line in done.stdout.splitlines() if line.startswith("python -m scenewright")]
    assert commands == expected


BASE = """
name = "p"
summary = "s"
[variables.log]
description = "a log"
[[step]]
name = "sequence"
stage = "ingest"
inputs = { log = "$log" }
"""


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (BASE.replace("ingest", "nonsense"), "no step"),
        (BASE.replace("$log", "$nonsense"), "not declared"),
        (BASE.replace("$log", "segments"), "not an earlier step"),
        (BASE.replace("log = ", "nonsense = "), "no input"),
        (BASE.replace("inputs = ", "parameters = { nonsense = 1 }\ninputs = "), "no parameter"),
        (BASE.replace('inputs = { log = "$log" }', ""), "missing"),
        (BASE + BASE[BASE.index("[[step]]") :], "two steps"),
        (BASE.replace('name = "sequence"', 'name = "../x"'), "not a name"),
        (BASE.replace("inputs = ", "shared = true\ninputs = "), "shared step has no inputs"),
        (BASE.replace("summary", "nonsense"), "summary: Field required"),
        ("not toml", "TOML"),
    ],
)
def test_wrong_pipelines_are_refused_before_anything_runs(tmp_path: Path, text: str, match: str) -> None:
    path = tmp_path / "p.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=match):
        read_pipeline(path)


def test_a_chain_stops_at_the_first_failure(tmp_path: Path) -> None:
    calls: list[list[str]] = []

    def execute(arguments: list[str]) -> tuple[int, str]:
        calls.append(arguments)
        return (4, '{"status": "made", "outcome": "empty"}') if "segment" in arguments else (0, "{}")

    pipeline = read_pipeline(pipeline_path("reconstruct"))
    reports = run_pipeline(pipeline, tmp_path, {"log": "x"}, execute=execute)
    assert [report.name for report in reports] == ["sequence", "segments"]
    assert reports[-1].exit_code == 4 and len(calls) == 2
    assert "--weights" not in calls[1]


def test_what_is_given_is_looked_at_before_anything_runs(tmp_path: Path) -> None:
    pipeline = read_pipeline(pipeline_path("reconstruct"))
    values = resolve_variables(pipeline, {"log": str(tmp_path / "nowhere")})
    with pytest.raises(BadInput, match=r"log = .*nowhere: no such file or folder"):
        check_given_inputs(pipeline, values)
    check_given_inputs(pipeline, values, only=("cad_library",))  # which does not read it
    with pytest.raises(MissingDependency, match=r"https://github.com/.*yolox_nano.onnx"):
        check_given_inputs(pipeline, {**values, "log": str(tmp_path), "weights": "models/yolox_nano.onnx"})
    check_given_inputs(pipeline, {**values, "log": str(tmp_path)})


def test_make_looks_at_the_log_before_it_builds_a_library(tmp_path: Path) -> None:
    words = [
        "make",
        "--no-print-directory",
        "-n",
        "-f",
        "data/pipelines/reconstruct.mk",
        f"OUTPUTS={tmp_path}",
        f"LOG={tmp_path}/nowhere",
    ]
    done = subprocess.run(words, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "nowhere: no such file or folder" in done.stderr and done.stdout == ""
    words[-1] = f"LOG={tmp_path}"
    named = subprocess.run([*words, "WEIGHTS=yolox_nano"], cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert named.returncode == 0 and "--weights 'yolox_nano'" in named.stdout  # one of the cache has no path


def test_a_run_ends_with_the_gravest_code_of_its_steps() -> None:
    went_on = StepReport("interactive_scene", 0, {"outcome": "unsettled"})
    assert went_on.code() == 4 and went_on.code(("unsettled",)) == 0
    assert StepReport("report", 0, {"outcome": "ok"}).code() == 0
    assert StepReport("plan", 0, {"status": "would run", "outcome": "unknown"}).code() == 0
    assert StepReport("fuse", 6, {}).code(("empty",)) == 6


def test_a_log_without_poses_is_noticed_before_it_is_segmented(tmp_path: Path) -> None:
    def execute(arguments: list[str]) -> tuple[int, str]:
        return 0, '{"summary": {"posed_frames": 0}}' if "ingest" in arguments else "{}"

    pipeline = read_pipeline(pipeline_path("reconstruct"))
    with pytest.raises(BadInput, match="run reconstruct-without-poses"):
        run_pipeline(pipeline, tmp_path, {"log": "x"}, execute=execute)


def test_the_library_is_shared_by_runs_beside_each_other() -> None:
    pipeline = read_pipeline(pipeline_path("reconstruct"))
    library = next(step for step in pipeline.step if step.name == "cad_library")
    words = step_arguments(library, "outputs/a", {})
    assert words[words.index("--shared") + 1] == "outputs/a/../.shared"


def test_batch_file_is_checked_and_gives_the_gravest_code(tmp_path: Path) -> None:
    path = tmp_path / "b.toml"
    path.write_text('pipeline = "reconstruct"\n[[scene]]\nname = "a"\nset = { log = "x" }\n[[scene]]\nname = "b"\n')
    with pytest.raises(UsageError, match="needs log"):
        read_batch(path)
    path.write_text('pipeline = "reconstruct"\nset = { log = "x" }\n[[scene]]\nname = "a"\n[[scene]]\nname = "a"\n')
    with pytest.raises(UsageError, match="unique"):
        read_batch(path)
    assert worst_exit_code([0, 4, 3, 0]) == 3
    assert worst_exit_code([0, 4, 1]) == 1
    assert worst_exit_code([]) == 0


def test_no_target_of_make_deletes_on_error() -> None:
    for path in [REPOSITORY / "Makefile", *PIPELINES_FOLDER.glob("*.mk")]:
        assert not re.search(r"^\.DELETE_ON_ERROR", path.read_text(), re.MULTILINE)

"""Exit codes, one-line errors, standard output for data only."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scenewright.cli.main import run
from scenewright.stages.kit.configuration import parameters_for

from tests.contract.probe_step import PROBE

REPOSITORY = Path(__file__).resolve().parents[2]


def scenewright(*arguments: str | Path, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "scenewright", *map(str, arguments)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        **options,
    )


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("nonsense",), 2, "No such command"),
        (("graph",), 2, "--panoptic-map"),
        (("fuse", "--nonsense", "1"), 2, "--nonsense"),
        (("library", "build", "--out", "{tmp}/l", "--seed", "-1"), 2, "--seed"),
        (("library", "build", "--out", "{tmp}/l", "--seed", "x"), 2, "--seed"),
        (("ingest", "--log", "{tmp}/nowhere", "--out", "{tmp}/s"), 3, "no such file"),
        (("graph", "--panoptic-map", "{tmp}", "--out", "{tmp}/g"), 3, "not an artifact"),
        (("library", "build", "--out", "/proc/nowhere/l"), 6, "--out"),
        (("run", "nonsense", "--out", "{tmp}/r"), 2, "no pipeline"),
        (("run", "reconstruct", "--out", "{tmp}/r"), 2, "needs log"),
        (("run", "reconstruct", "--set", "nonsense=1", "--out", "{tmp}/r"), 2, "no variable"),
        (("batch", "{tmp}/nowhere.toml", "--out", "{tmp}/r"), 2, "nowhere.toml"),
        (("verify", "{tmp}"), 3, "damaged"),
        (("inspect", "{tmp}"), 3, "not an artifact"),
        (("library", "build", "--config", "{tmp}/nowhere.toml", "--out", "{tmp}/l"), 2, "nowhere.toml"),
        (("models", "--check", "{tmp}/nowhere.onnx"), 3, "no such file"),
    ],
)
def test_errors_are_one_line_with_the_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple, code: int, words: str
) -> None:
    assert run([argument.replace("{tmp}", str(tmp_path)) for argument in arguments]) == code
    done = capsys.readouterr()
    errors = [line for line in done.err.splitlines() if line.startswith("error:")]
    assert len(errors) == 1 and words in errors[0], done.err
    assert "Traceback" not in done.err and done.out == ""
    assert not [path for path in tmp_path.rglob("*") if not path.name.startswith(".")]


def test_standard_output_carries_data_only(tmp_path: Path) -> None:
    done = scenewright("library", "build", "--out", tmp_path / "l", "--dry-run", "--json")
    facts = json.loads(done.stdout)
    assert done.returncode == 0 and facts["status"] == "would run" and facts["kind"] == "cad_library"
    assert scenewright("library", "build", "--out", tmp_path / "l", "--dry-run").stdout == f"{tmp_path}/l\n"
    assert scenewright("--version").stdout.count(".") == 2
    # pybullet greets on file descriptor 1 when it is imported; none of that may reach the data.
    assert isinstance(json.loads(scenewright("doctor", "--json").stdout), list)


def test_config_file_supplies_parameters_and_flags_win(tmp_path: Path) -> None:
    parameters = parameters_for(PROBE, {"files": 3, "text": None}, {"text": "config", "files": 9})
    assert (parameters.text, parameters.files) == ("config", 3)
    config = tmp_path / "c.toml"
    config.write_text("nonsense = 1\n")
    done = scenewright("library", "build", "--config", config, "--out", tmp_path / "l")
    assert done.returncode == 2 and "'nonsense'" in done.stderr
    config.write_text("this is not TOML")
    assert scenewright("library", "build", "--config", config, "--out", tmp_path / "l").returncode == 2


def test_interrupt_exits_with_130_and_leaves_nothing(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "scenewright", "library", "build", "--out", str(tmp_path / "l")],
        cwd=REPOSITORY,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 30
    while not list(tmp_path.glob(".l.partial-*")) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130, errors
    assert "interrupted" in errors and "Traceback" not in errors
    assert [path.name for path in tmp_path.iterdir()] == [".l.lock"]


def test_packages_of_other_people_may_be_called_as_our_folders(tmp_path: Path) -> None:
    for name in ("stages", "schemas", "cli"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise ImportError('not this one')")
    done = subprocess.run(
        [sys.executable, "-m", "scenewright", "fuse", "--help"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}:{REPOSITORY}"},
    )
    assert done.returncode == 0 and "--voxel-size" in done.stdout


def test_a_python_without_the_libraries_says_what_to_do() -> None:
    bare = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = [sys.executable, "-S", "-m", "scenewright", "--help"]  # -S: nothing that is installed
    done = subprocess.run(words, cwd=REPOSITORY, capture_output=True, text=True, env=bare)
    assert done.returncode == 5 and done.stderr.count("\n") == 1 and "make setup" in done.stderr

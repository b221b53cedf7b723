"""`scenewright inspect` on the command line: exit codes, JSON, what goes to which stream."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.stages.engine.given_inputs import check_given_inputs
from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline, resolve_variables
from scenewright.stages.ingest.preflight.report import InspectionReport

from tests.unit.ingest import tiny_room
from tests.unit.ingest.preflight.textured_room import CAMERA, painted, walk
from tests.unit.ingest.tiny_room import jpeg, millimetres, png, room_depth

KEYS = {
    "schema_version",
    "path",
    "format",
    "rule",
    "verdict",
    "reason",
    "fix",
    "findings",
    "frames",
    "damage",
    "notes",
    "streams",
    "clocks",
    "cameras",
    "other_cameras",
    "gravity",
    "steps",
    "command",
}
CAMERA_KEYS = {
    "name",
    "camera",
    "registered",
    "frames",
    "streams",
    "calibration",
    "depth",
    "poses",
    "registration",
    "pictures",
    "motion",
    "drift",
    "stereo",
}


def write_log(root: Path, count: int, change=lambda pose: pose) -> Path:
    """A 7-Scenes folder of the painted room."""
    root.mkdir()
    k = CAMERA
    np.savetxt(root / "camera-intrinsics.txt", [[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1]])
    for index, pose in enumerate(walk(count)):
        depth = room_depth(k, pose)
        (root / f"frame-{index:06d}.color.jpg").write_bytes(jpeg(painted(depth, k, pose)))
        (root / f"frame-{index:06d}.depth.png").write_bytes(png(millimetres(depth)))
        np.savetxt(root / f"frame-{index:06d}.pose.txt", change(pose))
    return root


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("good") / "log", 20)


@pytest.fixture(scope="module")
def bad(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("bad") / "log", 20, np.linalg.inv)


def inspect(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    code = run(["inspect", *map(str, arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_ready_log(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = inspect(capsys, good, "--quiet")
    assert code == 0 and out.startswith("verdict      ready") and "error" not in err
    assert "step         run reconstruct                  ready" in out


def test_the_command_to_run_is_ready_to_paste(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--fx", CAMERA.fx, "--fy", CAMERA.fy, "--cx", CAMERA.cx, "--cy", CAMERA.cy, "--frame-rate", 15]
    options += ["--pose-scale", 1, "--pose-convention", "as-is", "--depth-bits", "as-is", "--depth-scale", 1000]
    code, out, _ = inspect(capsys, good, "--quiet", *map(str, options))
    (line,) = [line for line in out.splitlines() if line.startswith("run it")]
    words = shlex.split(line.removeprefix("run it"))
    start = words.index("run")
    assert code == 0 and words[start : start + 4] == ["run", "reconstruct", "--set", f"log={good}"]
    given = dict(pair.split("=", 1) for pair in words if "=" in pair)
    assert float(given["fx"]) == CAMERA.fx and float(given["cy"]) == CAMERA.cy
    assert float(given["frame_rate"]) == 15 and given["depth_bits"] == given["pose_convention"] == "as-is"
    pipeline = read_pipeline(pipeline_path("reconstruct"))
    check_given_inputs(pipeline, resolve_variables(pipeline, given))  # it would be taken


def test_json_has_stable_keys(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = inspect(capsys, good, "--json", "--expect", "ready")
    document = json.loads(out)
    assert code == 0 and set(document) == KEYS and set(document["cameras"][0]) == CAMERA_KEYS
    assert InspectionReport.model_validate(document).verdict == "ready"
    assert out.count("\n") == 1 and "NaN" not in out


def test_wasted_log_exits_with_3_and_one_line(bad: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = inspect(capsys, bad, "--json")
    assert code == 3 and json.loads(out)["verdict"] == "wasted"
    errors = [line for line in err.splitlines() if line.startswith("error:")]
    assert len(errors) == 1 and "poses contradict depth" in errors[0]
    assert "(ingest with --pose-convention inverse)" in errors[0] and "Traceback" not in err
    assert inspect(capsys, bad, "--expect", "wasted", "--quiet")[0] == 0


def test_advice_is_taken_from_the_command_line(bad: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert inspect(capsys, bad, "--set", "pose_convention=inverse", "--quiet")[0] == 0


def test_other_expectations(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert inspect(capsys, good, "--expect", "wasted", "--quiet")[0] == 4
    assert inspect(capsys, good, "--set", "depth_scale=5000", "--quiet")[0] == 3


def test_page_from_the_command_line(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "pages" / "log.html"
    assert inspect(capsys, good, "--html", page, "--quiet")[0] == 0
    assert page.read_text().startswith("<!doctype html>")
    code, _, err = inspect(capsys, good, "--html", "/proc/nowhere/page.html", "--quiet")
    assert code == 6 and "--html" in err


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (("--set", "nonsense=1"), 2, "no parameter 'nonsense'"),
        (("--set", "depth_scale"), 2, "not name=value"),
        (("--set", "depth_scale=-1"), 2, "--depth-scale"),
        (("--set", "fx=abc"), 2, "--fx"),
        (("--set", "start=5", "--set", "stop=3"), 2, "stop 3"),
        (("--frames", "1"), 2, "--frames"),
        (("--frames", "-3"), 2, "--frames"),
    ],
)
def test_usage_errors(good: Path, capsys: pytest.CaptureFixture[str], options: tuple, code: int, words: str) -> None:
    found, out, err = inspect(capsys, good, *options)
    assert found == code and words in err and out == ""


def test_sequence_artifact_is_inspected_with_its_manifest(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "sequence"
    assert run(["ingest", "--log", str(good), "--out", str(folder), "--quiet"]) == 0
    capsys.readouterr()
    code, out, _ = inspect(capsys, folder, "--quiet", "--expect", "ok")
    assert code == 0 and out.startswith("kind       sequence version") and "\nverdict      ready" in out
    code, out, _ = inspect(capsys, folder, "--json")
    document = json.loads(out)
    assert document["kind"] == "sequence" and set(document["preflight"]) == KEYS
    assert document["preflight"]["frames"]["in_log"] == 20
    code, out, _ = inspect(capsys, folder, "--json", "--frames", "0")
    assert code == 0 and "preflight" not in json.loads(out)
    assert inspect(capsys, folder, "--set", "fx=5")[0] == 2
    assert inspect(capsys, folder, "--html", tmp_path / "s.html", "--quiet")[0] == 0


def test_sequence_made_of_bad_poses_is_found(bad: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "sequence"
    assert run(["ingest", "--log", str(bad), "--out", str(folder), "--gravity", "none", "--quiet"]) == 0
    capsys.readouterr()
    code, _, err = inspect(capsys, folder, "--quiet")
    assert code == 3 and "poses contradict depth" in err


def test_what_is_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = inspect(capsys, tmp_path / "nowhere", "--quiet")
    assert code == 3 and "no such log" in err
    code, out, err = inspect(capsys, tmp_path, "--quiet")
    assert code == 3 and "not an artifact" in err and out == ""
    garbage = tmp_path / "x.mcap"
    garbage.write_bytes(b"\x89MCAP0\r\n" + bytes(range(256)))
    code, _, err = inspect(capsys, garbage, "--quiet")
    assert code == 3 and err.count("error:") == 1 and "Traceback" not in err


def test_tiny_room_without_texture_is_judged_by_depth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Colour that changes from frame to frame and shows nothing must not be called wrong poses."""
    log = tiny_room.write_redwood(tmp_path / "log", tiny_room.frames(16))
    code, out, _ = inspect(capsys, log, "--json")
    document = json.loads(out)
    assert code == 0 and document["cameras"][0]["poses"]["verdict"] == "agree"
    flipped = [(c, d, p @ np.diag([1.0, -1, -1, 1])) for c, d, p in tiny_room.frames(16)]
    log = tiny_room.write_redwood(tmp_path / "flipped", flipped)
    code, out, _ = inspect(capsys, log, "--json")
    assert code == 3 and json.loads(out)["cameras"][0]["poses"]["best"]["convention"] == "opengl"

"""What a step is going to write: the table against measured runs, and what happens when it does not fit."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scenewright.cli.main import run
from scenewright.schemas.errors import MachineFailure
from scenewright.stages.engine import estimation
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.estimation import estimate_pipeline, estimate_step, measured, warn_or_refuse
from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline, resolve_variables
from scenewright.stages.kit.estimates import Estimate

from tests.unit.export.sequences import write_sequence
from tests.unit.housekeeping.artifacts import make_artifact
from tests.unit.housekeeping.small_step import SMALL, SmallParameters

DEMO = read_pipeline(pipeline_path("demo"))
MEASURED = {
    ("24", "240", "180", "0.04"): {
        "cad_library": (16.23, 189),
        "ground_truth": (9.80, 648),
        "sequence": (0.87, 111),
        "segments": (0.41, 223),
        "panoptic_map": (5.57, 269),
        "contact_graph": (0.08, 286),
        "cad_scene": (2.17, 489),
        "interactive_scene": (3.26, 185),
        "evaluation": (0.30, 392),
        "report": (0.94, 863),
    },
    ("60", "320", "240", "0.01"): {
        "ground_truth": (19.36, 556),
        "sequence": (3.88, 113),
        "segments": (1.07, 227),
        "panoptic_map": (134.23, 1043),
        "contact_graph": (0.10, 673),
        "cad_scene": (38.51, 492),
        "interactive_scene": (85.49, 1037),
    },
    ("120", "640", "480", "0.02"): {
        "ground_truth": (50.26, 830),
        "sequence": (32.28, 118),
        "segments": (3.56, 305),
        "panoptic_map": (31.47, 586),
        "contact_graph": (0.12, 396),
        "cad_scene": (9.14, 505),
        "interactive_scene": (17.66, 303),
        "plan": (2.14, 691),
        "evaluation": (0.37, 501),
        "report": (1.66, 1033),
    },
}
"""Frames, width, height, voxel size of `scenewright run demo` -> step -> (megabytes written, peak memory [MiB])."""


@pytest.mark.parametrize("settings", MEASURED, ids="-".join)
def test_whole_runs_are_foreseen(settings: tuple[str, ...], tmp_path: Path) -> None:
    """From the command line alone: disk within a factor of 1.9, memory within a factor of 1.6, lower bounds kept."""
    names = ("frames", "width", "height", "voxel_size")
    values = resolve_variables(DEMO, dict(zip(names, settings, strict=True)))
    found = estimate_pipeline(DEMO, tmp_path, values).steps
    for name, (megabytes, mebibytes) in MEASURED[settings].items():
        expected = found[name]
        assert expected is not None
        assert megabytes / 1.9 < expected.megabytes < megabytes * 1.9, name
        assert expected.lower <= megabytes, name
        assert mebibytes / 1.6 < expected.memory / 2**20 < mebibytes * 1.6, name


DECLARED = sorted(name for name, stage in all_stages().items() if stage.estimate is not None)


@example("ingest", 0.0, 5e-324, 1.0)
@given(st.sampled_from(DECLARED), st.floats(0, 1e7), st.floats(0, 1e6), st.floats(0, 1e6))
def test_estimates_are_sane_whatever_the_input(name: str, megabytes: float, frames: float, megapixels: float) -> None:
    stage = all_stages()[name]
    assert stage.estimate is not None
    for held in (Estimate(megabytes, megabytes), Estimate(megabytes, 0.0, 0.0, frames, megapixels)):
        expected = stage.estimate(stage.parameters(), dict.fromkeys(stage.reads, held))
        assert 0 <= expected.disk_lower <= expected.disk and expected.memory > 0


def test_what_is_on_the_disk_is_measured(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence")
    files = {path.name: path.read_bytes() for path in sequence.root.iterdir()}
    info = sequence.info
    folder = make_artifact(tmp_path / "artifact", "sequence", {"sequence.json": files["sequence.json"].decode()})
    amount = measured(folder)
    size = info.camera.width * info.camera.height / 1e6
    assert (amount.frames, amount.megapixels) == (5, pytest.approx(5 * size))
    assert amount.frame_megapixels == pytest.approx(size)
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "a.bin").write_bytes(b"x" * 2_000_000)
    assert measured(tmp_path / "log").megabytes == 2 and measured(tmp_path / "log" / "a.bin").megabytes == 2
    assert (
        estimate_step(all_stages()["ingest"], all_stages()["ingest"].parameters(), {"log": tmp_path / "nowhere"})
        is None
    )
    (folder / "manifest.json").write_text("{")
    assert measured(folder).megabytes > 0  # whoever opens it says what is wrong


def test_a_full_disk_is_known_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    expected = Estimate(100.0, 10.0, 1.0)
    monkeypatch.setattr(estimation, "free_bytes", lambda out: 5_000_000)
    with pytest.raises(MachineFailure, match=r"at least 10.0 MB, and 5.0 MB are free") as caught:
        warn_or_refuse("fuse", expected, tmp_path)
    assert caught.value.exit_code == 6

    def warned() -> str:
        caplog.clear()
        with caplog.at_level("WARNING", logger="scenewright"):
            warn_or_refuse("fuse", expected, tmp_path)
        return caplog.text

    monkeypatch.setattr(logging.getLogger("scenewright"), "propagate", True)
    monkeypatch.setattr(estimation, "free_bytes", lambda out: 50_000_000)
    assert "may fill the disk" in warned()
    monkeypatch.setattr(estimation, "free_bytes", lambda out: 500_000_000)
    assert warned() == ""
    monkeypatch.setattr(estimation, "available_memory", lambda: 1000)
    assert "may run out of memory" in warned()


def test_a_step_that_does_not_fit_does_not_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(estimation, "free_bytes", lambda out: 1000)
    assert run(["library", "build", "--out", str(tmp_path / "library")]) == 6
    assert "at least" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [".library.lock"]
    assert run(["run", "demo", "--out", str(tmp_path / "run")]) == 6
    assert "pipeline demo writes at least" in capsys.readouterr().err and not (tmp_path / "run").exists()


def test_dry_runs_say_what_it_costs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["library", "build", "--out", str(tmp_path / "library"), "--dry-run", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["estimate"]["disk_bytes"] == pytest.approx(16.32e6)
    assert run(["run", "demo", "--out", str(tmp_path / "run"), "--dry-run"]) == 0
    assert "to write" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_steps_that_nobody_measured_just_run(tmp_path: Path) -> None:
    from scenewright.stages.engine.runner import run_stage

    result = run_stage(SMALL, {}, tmp_path / "a", SmallParameters(), dry_run=True)
    assert result.estimate is None
    assert run_stage(SMALL, {}, tmp_path / "a", SmallParameters()).status == "made"


def test_what_is_there_costs_nothing_more(tmp_path: Path) -> None:
    values = resolve_variables(DEMO, {})
    before = estimate_pipeline(DEMO, tmp_path, values).total
    make_artifact(tmp_path / "ground_truth", "trajectory")
    after = estimate_pipeline(DEMO, tmp_path, values)
    assert "ground_truth" in after.there
    assert after.total.disk < before.disk and "is there" in "\n".join(after.lines())
    only = estimate_pipeline(DEMO, tmp_path, values, only=("segments",))
    assert list(only.steps) == ["segments"] and only.total.disk < 10e6

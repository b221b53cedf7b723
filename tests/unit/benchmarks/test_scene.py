"""The scene experiment's own parts: pooling over rooms, tables, which cases and files it takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.experiment import Bench, Results, Trial
from benchmarks.experiments.scene import measuring
from benchmarks.experiments.scene.arms import ARMS, MASK_LEVEL, PERFECT, REAL
from benchmarks.experiments.scene.experiment import EXPERIMENT
from benchmarks.experiments.scene.figures_of_merit import FIGURES
from benchmarks.experiments.scene.measuring import Outcome, SceneParameters
from benchmarks.generated_rooms import RoomFolder
from benchmarks.results import figures_of, table

GRAPH = {"edit_distance": 4.0, "wrong_support": 1.0, "missing_detection": 2.0, "wrong_detection": 0.0}


def outcome(agreed: int, objects: int, success: float) -> Outcome:
    cad: dict[str, float | None] = {"true_objects": objects, "detected": objects, "replaced": objects}
    cad |= {"scan2cad_success": success, "translation_error_m_mean": 0.02, "rotation_error_rad_mean": 0.1}
    physics = {"settled_rooms": 1.0, "collisions": 0.0}
    return Outcome(GRAPH, {"support": (10, 10, agreed)}, cad, physics=physics)


def bench_in(folder: Path, **parameters: object) -> Bench:
    given = {"maps": folder / "maps", "real": folder / "real"} | parameters
    return Bench(folder / "out", SceneParameters.model_validate(given))


def test_counts_and_objects_are_pooled_over_rooms() -> None:
    rooms = [outcome(10, 30, 1.0), outcome(5, 10, 0.2)]
    assert FIGURES["support_f1"](rooms) == pytest.approx(15 / 20)
    assert FIGURES["contains_f1"](rooms) is None
    assert FIGURES["scan2cad_success"](rooms) == pytest.approx((30 * 1.0 + 10 * 0.2) / 40)


def test_tables_show_what_was_run(tmp_path: Path) -> None:
    records = {
        Trial("ours", PERFECT, "a"): outcome(10, 30, 1.0),
        Trial("ours", PERFECT, "b"): outcome(5, 10, 0.2),
        Trial("best_single", PERFECT, "a"): outcome(10, 30, 1.0),
        Trial("best_single", PERFECT, "b"): outcome(5, 10, 1.0),
    }
    results = Results(EXPERIMENT, bench_in(tmp_path), records)
    found = figures_of(results)["ours/perfect/support_f1"]
    assert (found.value, found.low, found.high, found.cases) == (0.75, 0.5, 1.0, 2)
    text = table(results, figures_of(results))
    assert f"| measure | {EXPERIMENT.arms['best_single']} | ours |" in text
    difference = results.difference("ours", "best_single", PERFECT, "scan2cad_success")
    assert difference is not None
    assert (difference.value, difference.low, difference.high) == pytest.approx((-0.2, -0.8, 0.0))


def test_real_logs_are_a_case_only_where_they_have_run(tmp_path: Path) -> None:
    bench = bench_in(tmp_path)
    assert EXPERIMENT.default_cases and EXPERIMENT.seeds_of
    assert REAL not in EXPERIMENT.default_cases(bench) and EXPERIMENT.seeds_of(bench, REAL) == []
    log = min(measuring.ANNOTATIONS.glob("*.json")).stem
    manifest = tmp_path / "real" / log / "panoptic_map" / "manifest.json"
    manifest.parent.mkdir(parents=True)
    manifest.write_text("{}")
    assert REAL in EXPERIMENT.default_cases(bench) and EXPERIMENT.seeds_of(bench, REAL) == [log]


def test_maps_that_are_missing_are_measured_by_the_mapping_experiment(tmp_path: Path, monkeypatch) -> None:
    asked: list[tuple[Path, list[Trial]]] = []

    def measure_missing(experiment, bench, trials, *, any_code):
        asked.append((bench.out, trials))
        return 3

    monkeypatch.setattr(measuring, "make_room", lambda root, name, frames: RoomFolder(name, root / name))
    monkeypatch.setattr(measuring, "measure_missing", measure_missing)
    with pytest.raises(measuring.StepFailed) as failure:
        measuring.load_room(bench_in(tmp_path), "kitchen-1", with_maps=True)
    wanted = [Trial(arm, MASK_LEVEL, "kitchen-1") for arm in sorted({arm.map_arm for arm in ARMS})]
    assert asked == [(tmp_path / "maps", wanted)] and failure.value.exit_code == 3


def test_real_logs_begin_with_empty_folders(tmp_path: Path, monkeypatch) -> None:
    """A mesh that an earlier run left would stand in the scene as an obstacle."""
    stale = tmp_path / "kitchen" / ARMS[0].name / "cad_scene" / "meshes" / "book_1.ply"
    stale.parent.mkdir(parents=True)
    stale.write_text("")
    monkeypatch.setattr(measuring, "made", lambda words, out, *further: out)
    monkeypatch.setattr(measuring, "opened", lambda kind, path: kind(path))
    monkeypatch.setattr(measuring, "load_truth", lambda artifact, world_from_log, least: None)
    monkeypatch.setattr(measuring, "overlaps_of", lambda truth, panoptic_map: {})

    def build(*words: object, **inputs: object) -> None:
        assert not stale.exists()
        raise InterruptedError

    monkeypatch.setattr(measuring, "unrecorded", build)
    with pytest.raises(InterruptedError):
        next(measuring.run_real(tmp_path / "kitchen", tmp_path / "kitchen", ARMS))

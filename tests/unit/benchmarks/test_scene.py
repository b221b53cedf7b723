"""The scene benchmark's own parts: pooling over rooms, tables, which cases and files it takes."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import pytest

from benchmarks.mapping.rooms import RoomFolder
from benchmarks.scene import __main__ as program
from benchmarks.scene import real_logs
from benchmarks.scene.arms import ARMS, MASK_LEVEL, PERFECT, REAL, RECONSTRUCTED
from benchmarks.scene.experiment import Outcome
from benchmarks.scene.figures_of_merit import FIGURES, interval, paired_difference
from benchmarks.scene.tables import cad_table, differences, graph_table

GRAPH = {"edit_distance": 4.0, "wrong_support": 1.0, "missing_detection": 2.0, "wrong_detection": 0.0}


def outcome(room: str, arm: str, agreed: int, objects: int, success: float) -> Outcome:
    cad: dict[str, float | None] = {"true_objects": objects, "detected": objects, "replaced": objects}
    cad |= {"scan2cad_success": success, "translation_error_m_mean": 0.02, "rotation_error_rad_mean": 0.1}
    physics = {"settled_rooms": 1.0, "collisions": 0.0}
    return Outcome(room, arm, PERFECT, GRAPH, {"support": (10, 10, agreed)}, cad, physics=physics)


def test_counts_and_objects_are_pooled_over_rooms() -> None:
    rooms = [outcome("a", "ours", 10, 30, 1.0), outcome("b", "ours", 5, 10, 0.2)]
    assert FIGURES["support_f1"](rooms) == pytest.approx(15 / 20)
    assert FIGURES["contains_f1"](rooms) is None and interval(FIGURES["contains_f1"], rooms) is None
    assert FIGURES["scan2cad_success"](rooms) == pytest.approx((30 * 1.0 + 10 * 0.2) / 40)
    found = paired_difference(FIGURES["scan2cad_success"], rooms, rooms)
    assert found is not None and (found.value, found.low, found.high) == (0.0, 0.0, 0.0)


def test_tables_show_what_was_run() -> None:
    results = {
        ("ours", PERFECT): [outcome("a", "ours", 10, 30, 1.0), outcome("b", "ours", 5, 10, 0.2)],
        ("best_single", PERFECT): [outcome("a", "best_single", 10, 30, 1.0), outcome("b", "best_single", 5, 10, 1.0)],
    }
    arms = {"thesis": "thesis", "best_single": "single", "ours": "ours"}
    graphs = graph_table(results, arms, [PERFECT, RECONSTRUCTED]).splitlines()[4:]
    assert len(graphs) == 1 and graphs[0].startswith("| perfect | ours | 2 | 75.0 [50.0, 100.0] |")
    replaced = cad_table(results, arms, [PERFECT]).splitlines()[4:]
    assert [row.split(" | ")[1] for row in replaced] == ["single", "ours"]
    assert "| 20 | 5.7 |" in replaced[1]  # 0.02 m, 0.1 rad
    assert differences(results, [PERFECT]).splitlines()[4:] == [
        "| perfect | best_single | 0.0 [0.0, 0.0] | -20.0 [-80.0, 0.0] | – | 0.0 [0.0, 0.0] | 0.0 [0.0, 0.0] "
        "| 0.0 [0.0, 0.0] |"
    ]


def test_real_logs_are_a_case_only_where_they_have_run(tmp_path: Path, monkeypatch, capsys) -> None:
    seen: list[list[str]] = []
    monkeypatch.setattr(program, "make_libraries", lambda options, room: None)
    monkeypatch.setattr(program, "_room_process", lambda options, cases, room: 0)
    monkeypatch.setattr(program, "read", lambda path: [])
    monkeypatch.setattr(program, "write_results", lambda options, outcomes, cases, rooms: seen.append(cases))
    folders = ["--out", str(tmp_path / "out"), "--maps", str(tmp_path / "maps"), "--real", str(tmp_path / "real")]
    assert program.main([*folders, "--quick"]) == 0
    assert REAL not in seen[0] and PERFECT in seen[0]
    with pytest.raises(SystemExit, match="2"):
        program.main([*folders, "--cases", REAL])
    assert "run `make real` first" in capsys.readouterr().err


def test_maps_that_were_missing_leave_no_outcome_of_some_arms(tmp_path: Path, monkeypatch) -> None:
    """`make bench-mapping` would take the room for done and lack every other arm in it."""
    file = tmp_path / "outcomes" / f"kitchen-1-{MASK_LEVEL}.json"
    file.parent.mkdir()
    commands: list[list[str]] = []

    def run(command: list[str], check: bool) -> None:
        commands.append(command)
        file.write_text("[]")

    monkeypatch.setattr(program.subprocess, "run", run)
    monkeypatch.setattr(program, "room_folder", lambda options, room: RoomFolder("kitchen-1", tmp_path / "room"))
    monkeypatch.setattr(program, "load_room", lambda folder, maps, libraries: None)
    monkeypatch.setattr(program, "run_case", lambda *given, keep: [])
    options = Namespace(maps=tmp_path, out=tmp_path / "out", quick=False, keep=False)
    assert program.one_room(options, [RECONSTRUCTED], ("kitchen", 1)) == 0
    assert "benchmarks.mapping" in commands[0] and not file.exists()


def test_real_logs_begin_with_empty_folders(tmp_path: Path, monkeypatch) -> None:
    """A mesh that an earlier run left would stand in the scene as an obstacle."""
    stale = tmp_path / "kitchen" / ARMS[0].name / "cad_scene" / "meshes" / "book_1.ply"
    stale.parent.mkdir(parents=True)
    stale.write_text("")
    monkeypatch.setattr(real_logs, "annotated_runs", lambda real: [Path("kitchen.json")])
    monkeypatch.setattr(real_logs.subprocess, "run", lambda command, check, stdout: None)
    monkeypatch.setattr(real_logs, "open_artifact", lambda path, kind: kind(path))
    monkeypatch.setattr(real_logs, "load_truth", lambda artifact, world_from_log, least: None)
    monkeypatch.setattr(real_logs, "overlaps_of", lambda truth, panoptic_map: {})

    def build(panoptic_map, *, parameters, context):
        assert not stale.exists()
        raise InterruptedError

    monkeypatch.setattr(real_logs, "build_graph", build)
    with pytest.raises(InterruptedError):
        real_logs.run_real(tmp_path, tmp_path, ARMS, 0)

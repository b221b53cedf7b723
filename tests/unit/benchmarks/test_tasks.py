"""The experiments on tasks: what their figures make of records; the parts of a target are put together."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from scenewright.schemas.errors import BadInput

from benchmarks.discovery import load_experiment
from benchmarks.experiment import Bench, Results, Trial, shown
from benchmarks.experiments.llm3 import experiment as llm3
from benchmarks.experiments.stitch_sight import Look, looks
from benchmarks.experiments.tidy_fast import arms as fast
from benchmarks.experiments.tidy_physics import Run, same_trial
from benchmarks.experiments.tidy_seen import Run as Seen
from benchmarks.gather import gather
from benchmarks.keeping import keep_record, kept_records
from benchmarks.results import figures_of

PHYSICS = Run(70.0, 12, 12, 0, 0, 0, 0, 6, 0, 0, 0, (), (), 1.0)


def results(name: str, records: dict[tuple[str, str, str], Any]) -> Results:
    experiment = load_experiment(name)
    bench = Bench(Path("nowhere"), experiment.parameters())
    return Results(experiment, bench, shown(experiment, {Trial(*at): record for at, record in records.items()}))


def figures(name: str, records: dict[tuple[str, str, str], Any]) -> dict[str, float]:
    return {key: figure.value for key, figure in figures_of(results(name, records)).items()}


def test_calls_are_compared_where_both_solve() -> None:
    run = llm3.Run(True, 1, 10, 0, 1, 0.1, 4, 0.7)
    records = {("ours", "hard/fill", str(seed)): run for seed in range(4)}
    rival = replace(run, motion_planner_calls=30)
    records |= {("backtracking", "hard/fill", str(seed)): replace(rival, success=seed != 3) for seed in range(4)}
    found = figures("llm3", records)
    assert found["backtracking/hard/fill/success"] == 0.75 and found["ours/hard/fill/motion_planner_calls"] == 10
    at = "backtracking/hard/fill"
    assert found[f"{at}/calls_over_ours"] == 3.0 and found[f"{at}/both_solve"] == 3
    assert found[f"{at}/only_ours_solves"] == 1 and found[f"{at}/only_the_rival_solves"] == 0


def test_fast_tables_are_shown_by_their_delay_and_no_slower_goes_by_the_means() -> None:
    def runs(time: float, first: float) -> tuple[fast.Run, ...]:
        run = fast.Run(0, 4, time, first, 2.0, 6.0, 0.0, 0.0, 0.25)
        return run, replace(run, delay=5, time=2 * time)

    times = {"ours": (80.0, 99.0), "pull": (100.0, 70.0), "stack": (110.0, 95.0), "random": (120.0, 120.0)}
    found = figures("tidy_fast", {(arm, "tier1/fast", "0"): runs(*pair) for arm, pair in times.items()})
    at = "ours/tier1/fast"
    assert found[f"{at}/no_slower_share"] == 1.0 and found[f"{at}/no_slower_share_one_draw"] == 0.0
    assert found[f"{at}/time_ratio"] == 1.5 and found[f"{at}/faster_than_pull"] == pytest.approx(0.2)
    assert found[f"{at}/delay5/time"] == 160.0 and f"{at}/delay3/time" not in found
    assert found[f"{at}/failures_policy"] == 1.0


def test_failures_are_counted_by_whose_fault_they_are() -> None:
    at = "pull/tier1/fast/seen"
    kinds = enumerate(("", "perception", "policy", ""))
    found = figures("tidy_seen", {("pull", "tier1/fast/seen", str(k)): Seen(90.0, 2.0, 0, 0, f, 9) for k, f in kinds})
    assert found[f"{at}/failure_rate"] == 0.5 and found[f"{at}/trials"] == 4.0
    assert found[f"{at}/failures_perception"] == found[f"{at}/failures_policy"] == 1.0


def test_ratios_in_physics_are_of_tables_that_both_ran() -> None:
    case = "tier1/physics"
    lost = replace(PHYSICS, time=40.0, moved=9, dropped=3, perception=3)
    records = {("random", case, "1"): replace(PHYSICS, time=80.0), ("random", case, "2"): replace(PHYSICS, time=10.0)}
    found = figures("tidy_physics", records | {("ours", case, "1"): lost})
    assert found[f"ours/{case}/time_ratio"] == 2.0 and found[f"ours/{case}/items_lost_share"] == 0.25
    assert found[f"ours/{case}/failures_perception"] == 1.0 and found[f"ours/{case}/failures_policy"] == 0.0
    assert found["ours/image/failed_tables"] == 1.0


def test_a_plan_for_a_far_bin_is_an_arm_of_its_own_and_delays_are_not() -> None:
    near, far = "tier2/physics/truth", "tier2/physics/truth/delay3"
    for arm in ("pull", "ours", "ours_far"):
        assert same_trial(Trial(arm, near, "1")) == same_trial(Trial(arm, far, "1"))
    assert same_trial(Trial("ours", far, "1")) != same_trial(Trial("ours_far", far, "1"))


def test_looks_are_shown_beside_the_error_model() -> None:
    row = Look(
        arm="ours",
        seed=1,
        sutures=4,
        sutures_neutral=4,
        attempts=5,
        seconds=500.0,
        errors="I",
        reasons=("why",),
        cpu_seconds=1.0,
        places={"tissue": {"right": 3, "wrong": 1}},
    )
    text = looks(results("stitch_sight", {("ours", "geometry", "1"): row}))
    assert "| geometry | ours | tissue | 4 | 75.0 | 0.0 | 0.0 | 25.0 |" in text
    assert "| geometry | ours | 1 | 4 | I | why |" in text


def test_what_is_kept_is_found_again_whatever_code_it_was_measured_with(tmp_path: Path) -> None:
    experiment = load_experiment("tidy_physics")
    trial = Trial("ours", "tier1/physics/truth", "3")
    with pytest.raises(BadInput, match="no trial of tidy_physics"):
        kept_records("tidy_physics", tmp_path)
    keep_record(experiment, Bench(tmp_path, experiment.parameters()), trial, "another key", PHYSICS, 1.0)
    assert kept_records("tidy_physics", tmp_path) == {trial: PHYSICS}


def test_parts_are_put_together_and_must_agree(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no part"):
        gather(tmp_path)
    for part, value in (("needle", 1.0), ("trials", 2.0)):
        (tmp_path / part).mkdir()
        (tmp_path / part / "metrics.json").write_text(json.dumps({f"ours/{part}/x": value, "all/views/trials": value}))
        (tmp_path / part / "table.md").write_text(f"of {part}\n")
    assert gather(tmp_path) == "## needle\n\nof needle\n\n## trials\n\nof trials\n"
    assert json.loads((tmp_path / "metrics.json").read_text())["ours/trials/x"] == 2.0
    (tmp_path / "trials" / "metrics.json").write_text(json.dumps({"ours/needle/x": 3.0}))
    with pytest.raises(BadInput, match="in another part"):
        gather(tmp_path)

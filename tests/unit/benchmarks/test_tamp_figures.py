"""Figures of tasks in rooms: what counts as a try, what as a success."""

from __future__ import annotations

import pytest

from benchmarks.experiments.planning_tamp.experiment import EXACT, RoomResult, figures


def result(task: str, reason: str = "", seconds: float = 2.0, seed: int = 0, case: str = EXACT) -> RoomResult:
    status = "executed" if not reason else "infeasible"
    return RoomResult(task, case, seed, not reason, status, reason, 8, {"plan": seconds})


def test_rooms_without_a_goal_are_no_tries_and_rooms_that_do_not_exist_do_not_count() -> None:
    results = [result("tidy-the-desk", seconds=seconds, seed=seed) for seed, seconds in enumerate((1.0, 2.0, 6.0))]
    results += [
        result("tidy-the-desk", "no_goal", seed=3),
        result("tidy-the-desk", "no_room", seed=4),
        result("tidy-the-desk", "no_path", seed=5),
    ]
    results += [result("stack-and-carry", "grasp_lost")]
    metrics = figures(results)
    key = f"tidy-the-desk/{EXACT}"
    assert metrics[f"{key}/rooms"] == 5 and metrics[f"{key}/goals"] == 4
    assert metrics[f"{key}/success"] == pytest.approx(3 / 4)
    assert 0.3 < metrics[f"{key}/success_low"] < 3 / 4 < metrics[f"{key}/success_high"] < 1
    assert metrics[f"{key}/failed_no_path"] == 1 and f"{key}/failed_no_goal" not in metrics
    assert metrics[f"{key}/seconds_plan"] == 2.0  # the median of 1, 2, 2, 6
    assert metrics[f"ours/{EXACT}/success"] == pytest.approx(3 / 5)
    assert metrics[f"stack-and-carry/{EXACT}/success"] == 0.0
    assert f"stack-and-carry/{EXACT}/actions" not in metrics


def test_what_a_reconstruction_lacks_is_its_failure() -> None:
    results = [result("tidy-the-desk"), result("tidy-the-desk", "no_goal", case="tamp_reconstructed")]
    results += [result("tidy-the-desk", "no_goal", seed=1, case=case) for case in (EXACT, "tamp_reconstructed")]
    metrics = figures(results)
    assert metrics["tidy-the-desk/tamp_reconstructed/goals"] == 1
    assert metrics["tidy-the-desk/tamp_reconstructed/success"] == 0.0
    assert metrics["tidy-the-desk/tamp_reconstructed/failed_no_goal"] == 1

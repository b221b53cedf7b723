"""Figures of tasks in rooms: what counts as a try, what as a success."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from benchmarks.experiments.planning_tamp.experiment import EXACT, ORACLE, RoomResult, chain, figures
from benchmarks.tabulation import Figure


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
    found = figures(results)
    key = f"tidy-the-desk/{EXACT}"
    success = found[f"{key}/success"]
    assert success is not None and success.value == pytest.approx(75.0) and success.cases == 4
    assert success.low is not None and success.high is not None and 30 < success.low < 75 < success.high < 100
    assert value(found, f"{key}/failed_no_path") == 1 and f"{key}/failed_no_goal" not in found
    assert value(found, f"{key}/plan") == 2.0  # the median of 1, 2, 2, 6
    assert value(found, f"all/{EXACT}/success") == pytest.approx(60.0)
    assert value(found, f"without stack-and-carry/{EXACT}/success") == pytest.approx(75.0)
    assert value(found, f"stack-and-carry/{EXACT}/success") == 0.0
    assert f"stack-and-carry/{EXACT}/actions" not in found


def test_what_a_reconstruction_lacks_is_its_failure() -> None:
    results = [result("tidy-the-desk"), result("tidy-the-desk", "no_goal", case=ORACLE)]
    results += [result("tidy-the-desk", "no_goal", seed=1, case=case) for case in (EXACT, ORACLE)]
    found = figures(results)
    success = found[f"tidy-the-desk/{ORACLE}/success"]
    assert success is not None and (success.value, success.cases) == (0.0, 1)
    assert value(found, f"tidy-the-desk/{ORACLE}/failed_no_goal") == 1


def test_eyes_are_measured_against_the_oracle_on_the_tasks_that_both_were_tried_on() -> None:
    tasks = ("tidy-the-desk", "put-away-in-drawer")
    results = [result(task, seed=seed, case=ORACLE) for task in tasks for seed in range(3)]
    results += [result("tidy-the-desk", "" if seed else "grasp_lost", seed=seed, case="perceived") for seed in range(3)]
    share = figures(results)["all/perceived/over the oracle"]
    assert share is not None and share.value == pytest.approx(2 / 3) and share.cases == 3
    assert share.low is not None and share.low < 2 / 3


def value(found: Mapping[str, Figure | None], key: str) -> float:
    figure = found[key]
    assert figure is not None
    return figure.value


def test_with_estimated_poses_the_map_is_made_of_them_and_stands_apart() -> None:
    inputs = {name: from_what for _, name, from_what, _ in chain(estimated=True)}
    assert inputs["estimated/panoptic_map"]["trajectory"] == "trajectory" and "panoptic_map" not in inputs
    made = {"ground_truth"}
    for name, from_what in inputs.items():
        assert {source.split("/log")[0] for source in from_what.values()} <= made
        made.add(name)
    assert name == "estimated/interactive_scene"

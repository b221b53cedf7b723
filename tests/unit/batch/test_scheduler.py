"""The scheduler with an executor that runs nothing."""

from __future__ import annotations

import time

import pytest
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scheduler import run_jobs

from tests.unit.batch.batches import FakeExecutor, job, result

JOBS = [job(f"s{k}") for k in range(10)]


def test_all_jobs_run_in_order_and_no_more_than_fit() -> None:
    executor, recorded = FakeExecutor(capacity=3), []
    progress = run_jobs(JOBS, executor, recorded.append)
    assert executor.order == [j.name for j in JOBS] and executor.most_held == 3
    assert [r.job for r in recorded] == executor.order == [r.job for r in progress.results]
    assert progress.ended == "all" and executor.closed == 1


def test_failures_do_not_stop_the_others() -> None:
    executor = FakeExecutor(play=lambda job: result(job.name, "crash" if job.name in ("s1", "s4") else "done"))
    progress = run_jobs(JOBS, executor, lambda r: None)
    assert len(progress.results) == 10 and progress.ended == "all"


def test_stop_after_failures_lets_the_running_ones_end() -> None:
    executor = FakeExecutor(capacity=2, play=lambda job: result(job.name, "bad input"))
    progress = run_jobs(JOBS, executor, lambda r: None, stop_after_failures=2)
    assert progress.ended == "failures"
    assert [r.job for r in progress.results] == ["s0", "s1", "s2"], "s2 was running when the second failed"


def test_interrupt_stops_what_runs_and_keeps_what_ended() -> None:
    recorded = []

    def play(job: Job) -> SceneResult:
        if job.name == "s3":
            raise KeyboardInterrupt
        return result(job.name)

    executor = FakeExecutor(play=play)
    progress = run_jobs(JOBS, executor, recorded.append)
    assert progress.ended == "interrupted" and executor.cancelled and executor.closed == 1
    assert [r.job for r in recorded] == ["s0", "s1", "s2"] == [r.job for r in progress.results]


def test_a_bug_stops_what_runs_and_is_raised() -> None:
    executor = FakeExecutor()
    with pytest.raises(RuntimeError, match="disk"):
        run_jobs(JOBS, executor, lambda r: (_ for _ in ()).throw(RuntimeError("disk")))
    assert executor.cancelled and executor.closed == 1


def test_a_cluster_that_shrinks_and_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "sleep", lambda seconds: setattr(executor, "size", 2))
    executor = FakeExecutor(capacity=0)
    assert len(run_jobs(JOBS, executor, lambda r: None).results) == 10


def test_a_thousand_jobs_cost_little() -> None:
    jobs = [job(f"s{k}") for k in range(1000)]
    begun = time.perf_counter()
    run_jobs(jobs, FakeExecutor(capacity=16), lambda r: None)
    assert time.perf_counter() - begun < 10 * 0.001 * len(jobs), "the aim is 10 ms a scene"

"""What the Ray executor does with lost workers, told by a runtime that only plays a cluster."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from scenewright.schemas.errors import MissingDependency, UsageError
from scenewright.stages.engine.batch.ray_executor import RayExecutor, fitting
from scenewright.stages.engine.batch.spec import RayOptions

from tests.unit.batch.batches import job, result


class RayError(Exception):
    """Anything that Ray reports."""


class NodeDied(RayError):
    """A worker went away."""


class TaskCancelled(RayError):
    """We asked for it."""


class TaskError(RayError):
    """Our own code raised on the worker."""

    cause = OSError("no such disk")


class PlayedCluster:
    """Ends tasks in their order, each with what `play` returns or raises."""

    exceptions = SimpleNamespace(RayError=RayError, RayTaskError=TaskError, TaskCancelledError=TaskCancelled)

    def __init__(self, play: Callable[[int], str], cpus: tuple[float, ...] = (2.0, 2.0)) -> None:
        self.play = play
        self.cpus = cpus
        self.submitted = 0
        self.cancelled: list[int] = []
        self.asked: dict[str, Any] = {}

    def is_initialized(self) -> bool:
        return True

    def nodes(self) -> list[dict[str, Any]]:
        return [{"Alive": cpus > 0, "Resources": {"CPU": abs(cpus), "memory": 8e9}} for cpus in self.cpus]

    def remote(self, function: object) -> PlayedCluster:
        return self

    def options(self, **given: Any) -> SimpleNamespace:
        self.asked = given

        def submit(text: str, warm: bool) -> int:
            self.submitted += 1
            return self.submitted

        return SimpleNamespace(remote=submit)

    def wait(self, references: list[int], *, num_returns: int, timeout: float) -> tuple[list[int], list[int]]:
        return references[:num_returns], references[num_returns:]

    def get(self, reference: int) -> str:
        return self.play(reference)

    def cancel(self, reference: int) -> None:
        self.cancelled.append(reference)


def make(play: Callable[[int], str], **options: Any) -> tuple[RayExecutor, PlayedCluster]:
    cluster = PlayedCluster(play, options.pop("cpus_of_nodes", (2.0, 2.0)))
    return RayExecutor(RayOptions(kind="ray", **options), 4 * 10**9, runtime=cluster), cluster  # type: ignore[arg-type]


def test_a_lost_worker_costs_an_attempt_and_is_recorded() -> None:
    def play(reference: int) -> str:
        if reference < 3:
            raise NodeDied(f"node {reference} is gone")
        return result("a").model_dump_json()

    executor, cluster = make(play)
    executor.submit(job("a"))
    ends = [executor.completed(0.0) for _ in range(3)]
    assert ends[:2] == [[], []] and cluster.submitted == 3
    (found,) = ends[2]
    assert (found.outcome, found.attempts) == ("done", 3)
    assert found.lost == ("NodeDied: node 1 is gone", "NodeDied: node 2 is gone")
    assert cluster.asked["max_retries"] == 0 and cluster.asked["memory"] == 4 * 10**9


def test_retries_are_bounded() -> None:
    def play(reference: int) -> str:
        raise NodeDied("gone")

    executor, cluster = make(play, retries=1)
    executor.submit(job("a"))
    assert executor.completed(0.0) == []
    (found,) = executor.completed(0.0)
    assert (found.outcome, found.exit_code, found.attempts, cluster.submitted) == ("lost worker", 6, 2, 2)
    assert found.fingerprint == "f-a" and "2 times" in found.reason


def test_an_error_of_ours_on_the_worker_is_a_crash() -> None:
    def play(reference: int) -> str:
        raise TaskError

    executor, _ = make(play)
    executor.submit(job("a"))
    (found,) = executor.completed(0.0)
    assert found.outcome == "crash" and "no such disk" in found.reason


def test_cancelled_scenes_have_no_result() -> None:
    def play(reference: int) -> str:
        raise TaskCancelled

    executor, cluster = make(play)
    executor.submit(job("a"))
    executor.cancel()
    assert cluster.cancelled == [1] and executor.completed(0.0) == []


def test_capacity_follows_the_nodes() -> None:
    executor, cluster = make(lambda reference: "", cpus_of_nodes=(4.0, 2.0, -8.0))
    assert executor.capacity() == 4 + 1, "8 GB hold two scenes of 4 GB on each node, one more waits, the dead node none"
    cluster.cpus = (1.0,)
    assert executor.capacity() == 2
    cluster.cpus = (-1.0,)
    assert executor.capacity() == 0
    limited, _ = make(lambda reference: "", jobs=3)
    assert limited.capacity() == 3
    with pytest.raises(UsageError, match="CPU 64"):
        make(lambda reference: "", cpus=64.0)
    assert fitting({"CPU": 4.0, "gpu": 1.0}, {"CPU": 1.0, "gpu": 0.5}) == 2
    assert fitting({"CPU": 4.0}, {"CPU": 1.0, "gpu": 0.5}) == 0


def test_without_ray_the_user_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependency, match="cluster"):
        RayExecutor(RayOptions(kind="ray"))

"""Handing out jobs and taking in results. Knows nothing of processes, clusters or pipelines."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from scenewright.stages.engine.batch.executor import Executor
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult

TICK = 0.25
"""The longest wait between two looks of the display [s]."""


class Observer(Protocol):
    """Is told what happens, and shows it."""

    def submitted(self, job: Job) -> None:
        """A job was handed to the executor."""
        ...

    def finished(self, result: SceneResult) -> None:
        """A job has ended and its result is on disk."""
        ...

    def tick(self) -> None:
        """Nothing happened for a moment."""
        ...


class SilentObserver:
    """Shows nothing."""

    def submitted(self, job: Job) -> None:
        """Nothing."""

    def finished(self, result: SceneResult) -> None:
        """Nothing."""

    def tick(self) -> None:
        """Nothing."""


@dataclass
class Progress:
    """How a batch went."""

    results: list[SceneResult] = field(default_factory=list)
    """In the order of their end."""
    ended: Literal["all", "failures", "interrupted"] = "all"
    """Why no more was run."""


def run_jobs(
    jobs: Sequence[Job],
    executor: Executor,
    record: Callable[[SceneResult], None],
    *,
    stop_after_failures: int | None = None,
    observer: Observer | None = None,
) -> Progress:
    """Run all jobs in their order, as many at once as the executor takes; one failure does not stop the others.

    Each result is recorded before anything else happens to it. After `stop_after_failures` scenes that did not end
    well no further one is started. On Ctrl-C the running scenes are stopped and what has ended is returned.
    The executor is closed in any case.
    """
    observer = observer or SilentObserver()
    waiting = deque(jobs)
    running: set[str] = set()
    progress = Progress()
    failures = 0

    def take(results: list[SceneResult]) -> None:
        nonlocal failures
        for result in results:
            record(result)
            progress.results.append(result)
            running.discard(result.job)
            failures += result.outcome != "done"
            observer.finished(result)

    try:
        while waiting or running:
            if stop_after_failures is not None and failures >= stop_after_failures:
                progress.ended = "failures"
                waiting.clear()
            capacity = executor.capacity() if waiting else 0
            while waiting and len(running) < capacity:
                job = waiting.popleft()
                executor.submit(job)
                running.add(job.name)
                observer.submitted(job)
            if running:
                take(executor.completed(TICK))
            elif waiting:
                time.sleep(TICK)  # a cluster without a fitting node at the moment
            observer.tick()
    except KeyboardInterrupt:
        progress.ended = "interrupted"
        executor.cancel()
        take(executor.completed(0.0))
    except BaseException:
        executor.cancel()
        raise
    finally:
        executor.close()
    return progress

"""What the scheduler asks of whatever runs scenes: processes here, a cluster, or a fake in a test."""

from __future__ import annotations

from typing import Protocol

from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult


class Executor(Protocol):
    """Runs jobs somewhere. Only the scheduler's thread calls it."""

    def capacity(self) -> int:
        """Return how many jobs it can hold at the moment; asked again each time, as clusters change."""
        ...

    def submit(self, job: Job) -> None:
        """Take a job. Its name is its handle."""
        ...

    def completed(self, timeout: float) -> list[SceneResult]:
        """Wait up to `timeout` [s] for the end of any job and return what has ended since the last call."""
        ...

    def cancel(self) -> None:
        """Stop every job, with its processes, and wait for that. Jobs stopped so have no result."""
        ...

    def close(self) -> None:
        """Free what it holds. Called once, after the last job or after `cancel`."""
        ...

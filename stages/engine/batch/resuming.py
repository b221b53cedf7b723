"""Which scenes a batch has to run again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from scenewright.stages.engine.batch.artifacts import is_still_there
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.storage import stored_digest

Retry = Literal["failed", "none", "all"]
RETRY: tuple[Retry, ...] = ("failed", "none", "all")


def reason_to_run(job: Job, previous: SceneResult | None, retry: Retry) -> str | None:
    """Return why a scene has to run, or None when what came of it before still stands.

    Values, pipeline, steps' versions and raw inputs are compared by fingerprint; a scene that ended well has its last
    artifact looked at. A scene that somebody interrupted has not been run.
    """
    if retry == "all":
        return "every scene is to run again"
    if previous is None:
        return "has not run"
    if previous.outcome == "interrupted":
        return "was interrupted"
    if previous.fingerprint != job.fingerprint:
        return "its values, pipeline or inputs have changed"
    if previous.outcome != "done":
        return f"ended with: {previous.outcome}" if retry == "failed" else None
    last = job.steps[-1] if job.steps else None
    if last in previous.artifacts and not _stands(job, last, previous.artifacts[last]):
        return f"the artifact of {last} is gone or has changed"
    return None


def _stands(job: Job, step: str, digest: str) -> bool:
    if job.storage is not None:
        return stored_digest(job.storage, step, job.storage_timeout) == digest
    return is_still_there(Path(job.folder), step, digest)


def missing_jobs(jobs: Sequence[Job], latest: Mapping[str, SceneResult], retry: Retry) -> dict[str, str]:
    """Return job name -> why it has to run, for those that do."""
    reasons = ((job.name, reason_to_run(job, latest.get(job.name), retry)) for job in jobs)
    return {name: reason for name, reason in reasons if reason is not None}

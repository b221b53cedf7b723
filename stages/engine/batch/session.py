"""A batch from its file to its summary: what the command line calls."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.batch.display import display_for
from scenewright.stages.engine.batch.executor import Executor
from scenewright.stages.engine.batch.expansion import Batch, SceneCommand, make_jobs, scene_command
from scenewright.stages.engine.batch.folder_lock import folder_lock
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.local_executor import LocalExecutor
from scenewright.stages.engine.batch.outcomes import worst_exit_code
from scenewright.stages.engine.batch.results import RESULTS_NAME, ResultsFile, SceneResult, latest_by_job, read_results
from scenewright.stages.engine.batch.resuming import Retry, missing_jobs
from scenewright.stages.engine.batch.scheduler import run_jobs
from scenewright.stages.engine.batch.slurm_executor import (
    FOLDER_NAME,
    Scripts,
    merge_parts,
    part_of,
    part_path,
    read_job_list,
    write_scripts,
)
from scenewright.stages.engine.batch.spec import LocalOptions, RayOptions, SlurmOptions
from scenewright.stages.engine.batch.storage import check_storage
from scenewright.stages.engine.batch.summary import NOT_RUN
from scenewright.stages.engine.batch.summary_files import write_summary

Say = Callable[[str], None]


@dataclass(frozen=True)
class BatchEnd:
    """How a batch stands after a command."""

    jobs: tuple[Job, ...]
    """All of the batch file."""
    latest: dict[str, SceneResult]
    """The result of each job that has one and whose values have not changed since."""
    ran: tuple[SceneResult, ...]
    """What this command has run."""

    @property
    def exit_code(self) -> int:
        """The gravest code of the scenes."""
        return worst_exit_code(result.exit_code for result in self.latest.values())

    def counts(self) -> dict[str, int]:
        """Return outcome -> number of scenes, those not run included."""
        counted: dict[str, int] = {}
        for job in self.jobs:
            name = self.latest[job.name].outcome if job.name in self.latest else NOT_RUN
            counted[name] = counted.get(name, 0) + 1
        return counted


def make_executor(batch: Batch, jobs: int | None) -> Executor:
    """Return the executor that the batch file asks for; `jobs` (from the command line) wins over the file's."""
    options = batch.spec.executor
    if isinstance(options, RayOptions):
        from scenewright.stages.engine.batch.ray_executor import RayExecutor

        chosen = options.model_copy(update={"jobs": jobs}) if jobs else options
        return RayExecutor(chosen, batch.spec.limits.memory)
    if isinstance(options, LocalOptions):
        return LocalExecutor(jobs or options.jobs, options.threads, warm=options.warm)
    return LocalExecutor(jobs or 1, options.cpus)


def absolute(path: Path) -> Path:
    """Return the path from the root of the file system, links left as they are."""
    return Path(os.path.abspath(path))


def _standing(jobs: Sequence[Job], results: Sequence[SceneResult]) -> dict[str, SceneResult]:
    """Return the latest result of each job, where it is still about the same values and inputs."""
    latest = latest_by_job(results)
    return {job.name: latest[job.name] for job in jobs if _is_current(job, latest.get(job.name))}


def _is_current(job: Job, result: SceneResult | None) -> bool:
    return result is not None and result.fingerprint == job.fingerprint


def _title(batch: Batch) -> str:
    return f"Batch {batch.path.stem}: {batch.pipeline.name}"


def plan_batch(
    batch: Batch, out: Path, *, retry: Retry = "failed", force: bool = False
) -> list[tuple[Job, str | None]]:
    """Return every job with why it would run, or None where it would not. Writes nothing."""
    out = absolute(out)
    jobs = make_jobs(batch, out, force=force)
    reasons = missing_jobs(jobs, latest_by_job(read_results(out / RESULTS_NAME)), "all" if force else retry)
    return [(job, reasons.get(job.name)) for job in jobs]


def run_batch(
    batch: Batch,
    out: Path,
    *,
    jobs: int | None = None,
    force: bool = False,
    retry: Retry = "failed",
    say: Say = lambda text: None,
    terminal: bool = False,
    quiet: bool = False,
    executor: Executor | None = None,
    command: SceneCommand = scene_command,
) -> BatchEnd:
    """Run what is missing and write the summary, also when it is interrupted (KeyboardInterrupt goes on).

    Raises MachineFailure when another batch holds the folder or it cannot be written, and what the executor raises
    when it cannot start.
    """
    out = absolute(out)
    with folder_lock(out), ResultsFile(out / RESULTS_NAME) as results:
        if results.repaired:
            say(f"{RESULTS_NAME}: a torn last line of {results.repaired} bytes was cut off; its scene runs again")
        merge_parts(out, results)
        all_jobs = make_jobs(batch, out, force=force, command=command)
        if batch.spec.storage is not None:
            check_storage(batch.spec.storage.url, batch.spec.storage.timeout)
        reasons = missing_jobs(all_jobs, latest_by_job(read_results(results.path)), "all" if force else retry)
        todo = [job for job in all_jobs if job.name in reasons]
        say(f"{len(all_jobs)} scenes: {len(todo)} to run, {len(all_jobs) - len(todo)} stand as they are")
        ran, ended = [], "all"
        if todo:
            chosen = executor or make_executor(batch, jobs)
            with display_for(len(todo), say, terminal=terminal, quiet=quiet) as display:
                progress = run_jobs(
                    todo,
                    chosen,
                    results.append,
                    stop_after_failures=batch.spec.limits.stop_after_failures,
                    observer=display,
                )
            ran, ended = progress.results, progress.ended
        end = BatchEnd(tuple(all_jobs), _standing(all_jobs, read_results(results.path)), tuple(ran))
        write_summary(out, _title(batch), end.jobs, end.latest)
    if ended == "failures":
        say(f"stopped after {batch.spec.limits.stop_after_failures} failures; running again goes on")
    if ended == "interrupted":
        raise KeyboardInterrupt
    return end


def write_array(
    batch: Batch, out: Path, *, jobs: int | None = None, force: bool = False, retry: Retry = "failed"
) -> Scripts | None:
    """Write the scripts of a Slurm job array for what is missing; None where nothing is."""
    out, options = absolute(out), batch.spec.executor
    if not isinstance(options, SlurmOptions):
        raise UsageError(f"{batch.path}: executor {options.kind!r} writes no scripts", hint='kind = "slurm"')
    if jobs:
        options = options.model_copy(update={"jobs": jobs})
    with folder_lock(out), ResultsFile(out / RESULTS_NAME) as results:
        merge_parts(out, results)
        planned = plan_batch(batch, out, retry=retry, force=force)
        todo = [job for job, reason in planned if reason is not None]
        extra = ["--force"] if force else [] if retry == "failed" else ["--retry", retry]
        return write_scripts(batch.path, out, todo, options, extra) if todo else None


def run_task(
    batch: Batch,
    out: Path,
    index: int,
    count: int,
    *,
    force: bool = False,
    retry: Retry = "failed",
    say: Say = lambda text: None,
    quiet: bool = False,
    executor: Executor | None = None,
    command: SceneCommand = scene_command,
) -> BatchEnd:
    """Run one task of a job array: its part of the job list, with results of its own."""
    out = absolute(out)
    names = part_of(read_job_list(out), index, count)
    by_name = {job.name: job for job in make_jobs(batch, out, force=force, command=command)}
    unknown = [name for name in names if name not in by_name]
    if unknown:
        raise UsageError(f"{batch.path}: has no scene {unknown[0]!r} any more", hint="write the scripts again")
    jobs_of_task = [by_name[name] for name in names]
    path = part_path(out, index)
    with (
        folder_lock(out, shared=True),
        folder_lock(out / FOLDER_NAME, name=f".task-{index}.lock"),
        ResultsFile(path) as results,
    ):
        before = [*read_results(out / RESULTS_NAME), *read_results(path)]
        reasons = missing_jobs(jobs_of_task, latest_by_job(before), "all" if force else retry)
        todo = [job for job in jobs_of_task if job.name in reasons]
        with display_for(len(todo), say, terminal=False, quiet=quiet) as display:
            progress = run_jobs(
                todo,
                executor or make_executor(batch, 1),
                results.append,
                stop_after_failures=batch.spec.limits.stop_after_failures,
                observer=display,
            )
        standing = _standing(jobs_of_task, [*before, *progress.results])
    if progress.ended == "interrupted":
        raise KeyboardInterrupt
    return BatchEnd(tuple(jobs_of_task), standing, tuple(progress.results))


def collect_tasks(batch: Batch, out: Path) -> BatchEnd:
    """Join the results of all array tasks and write the summary."""
    out = absolute(out)
    with folder_lock(out), ResultsFile(out / RESULTS_NAME) as results:
        merge_parts(out, results)
        jobs = make_jobs(batch, out)
        end = BatchEnd(tuple(jobs), _standing(jobs, read_results(results.path)), ())
        write_summary(out, _title(batch), end.jobs, end.latest)
    return end

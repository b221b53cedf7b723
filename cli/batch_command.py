"""The command `batch`."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from scenewright.cli import output
from scenewright.cli.output import say as _say
from scenewright.schemas.errors import UsageError

if TYPE_CHECKING:
    from scenewright.stages.engine.batch.session import BatchEnd


def batch(
    spec: Annotated[Path, typer.Argument(help="Batch file (TOML): pipeline, scenes or data, parameters, seeds.")],
    out: Annotated[Path, typer.Option("--out", help="Folder; one run folder per scene in it.")],
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Scenes at once [default: the file's, or 1].")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Make every artifact again.")] = False,
    retry: Annotated[
        str, typer.Option("--retry", help="Scenes to run again besides those that have not run: failed, none or all.")
    ] = "failed",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say which scenes would run and why.")] = False,
    task: Annotated[
        str | None, typer.Option("--task", help="INDEX/COUNT: run this part; the scripts of a job array do.")
    ] = None,
    collect: Annotated[bool, typer.Option("--collect", help="Join the results of a job array's tasks.")] = False,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Warnings only.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Run a pipeline over a data set; exits with the gravest code of its scenes (docs/BATCH.md)."""
    from scenewright.stages.engine.batch import session
    from scenewright.stages.engine.batch.expansion import read_batch
    from scenewright.stages.engine.batch.resuming import RETRY
    from scenewright.stages.engine.batch.slurm_executor import parse_task

    if retry not in RETRY:
        raise UsageError(f"--retry {retry!r}: there is no such choice", hint=f"choose one of {', '.join(RETRY)}")
    silent = quiet or json_output
    say = (lambda text: None) if silent else _say
    batch_to_run = read_batch(spec)
    if dry_run:
        planned = session.plan_batch(batch_to_run, out, retry=retry, force=force)
        for job, reason in planned:
            say(f"{'would run' if reason else 'up to date':11} {job.name:32} {reason or ''}")
        return _report({"batch": str(out), "scenes": {job.name: reason for job, reason in planned}}, json_output, 0)
    if task is not None:
        index, count = parse_task(task)
        end = session.run_task(batch_to_run, out, index, count, force=force, retry=retry, say=say, quiet=silent)
    elif collect:
        end = session.collect_tasks(batch_to_run, out)
    elif batch_to_run.spec.executor.kind == "slurm":
        scripts = session.write_array(batch_to_run, out, jobs=jobs, force=force, retry=retry)
        if scripts is None:
            say("no scene has to run; --retry all runs them again")
            return _report_end(session.collect_tasks(batch_to_run, out), out, say, json_output)
        say(f"{scripts.scenes} scenes in {scripts.tasks} array tasks; submit them with: {scripts.submit}")
        return _report({"batch": str(out), "submit": str(scripts.submit)}, json_output, 0)
    else:
        with contextlib.redirect_stdout(sys.stderr):  # Ray prints what it notices about nodes; that is no data
            end = session.run_batch(
                batch_to_run,
                out,
                jobs=jobs,
                force=force,
                retry=retry,
                say=say,
                terminal=sys.stderr.isatty(),
                quiet=silent,
            )
    return _report_end(end, out, say, json_output)


def _report_end(end: BatchEnd, out: Path, say: Callable[[str], None], json_output: bool) -> int:
    """Say what became of every scene, and return the exit code of the worst."""
    say(", ".join(f"{count} {name}" for name, count in end.counts().items()))
    scenes = {job.name: end.latest[job.name].model_dump(mode="json") for job in end.jobs if job.name in end.latest}
    return _report({"batch": str(out), "counts": end.counts(), "scenes": scenes}, json_output, end.exit_code)


def _report(facts: dict[str, object], json_output: bool, code: int) -> int:
    output.out(json.dumps(facts, sort_keys=True) if json_output else str(facts["batch"]))
    return code

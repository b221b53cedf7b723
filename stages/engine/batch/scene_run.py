"""Running one scene: its own process group, watched for time and memory, everything it says in one log.

Every executor ends here, on whatever machine. What it returns is all the batch learns about the scene.
"""

from __future__ import annotations

import json
import os
import resource
import select
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import psutil
from scenewright.schemas.errors import BadInput, ScenewrightError
from scenewright.schemas.outside import file_json
from scenewright.stages.engine.batch.artifacts import manifests, measures
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.outcomes import MACHINE_FAILED, Outcome, classify, signal_name, signal_of
from scenewright.stages.engine.batch.processes import (
    created_at,
    end_group,
    group_is_alive,
    resident_memory,
    signal_group,
)
from scenewright.stages.engine.batch.quantities import format_bytes, format_seconds
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scene_log import LOG_NAME, LogFollower, clean
from scenewright.stages.engine.batch.storage import drop_local, send
from scenewright.stages.engine.estimation import free_bytes
from scenewright.stages.engine.forking import Process
from scenewright.stages.engine.own_code import own_code

LAUNCHER = Path(__file__).with_name("launcher.py")
PROCESS_NAME = ".batch-process.json"
"""Beside the log while a scene runs: who runs it, for the next batch to end it if this one is killed."""
LONGEST_PAUSE = 0.05
"""Longest time between two looks at the process [s]."""
SAMPLE_INTERVAL = 0.25
"""Time between two looks at the process's memory [s]."""
MEMORY_GRACE = 1.0
"""A scene over its memory limit endangers the others: it has this long to stop [s]."""


LARGEST_RECORD = 64 * 2**10
"""Bytes of what a scene notes about its process."""


def this_host() -> str:
    """Return the name of this machine."""
    return socket.gethostname()


@dataclass
class _Watched:
    """What watching a process group found."""

    status: int = 0
    stopped_by: Outcome | None = None
    peak_memory: int = 0
    processor_seconds: float = 0.0


def end_leftover(folder: Path, grace: float) -> None:
    """End the scene that a killed batch has left running in `folder` on this machine, if there is one."""
    record = folder / PROCESS_NAME
    try:
        facts = file_json(record, LARGEST_RECORD)
        group, created, host = int(facts["group"]), float(facts["created"]), str(facts["host"])
        if not 0 < group < 2**31:
            return
    except (BadInput, ValueError, KeyError, TypeError):
        return
    # The leader may be gone and its step not; while a member lives, no new process gets the number of the group.
    if host == this_host() and created_at(group) in (created, None) and group_is_alive(group):
        end_group(group, grace)
    record.unlink(missing_ok=True)


class _Pauses:
    """Pauses that end early when a process of ours ends, where the kernel can tell (Linux)."""

    def __init__(self, pid: int) -> None:
        self._descriptor: int | None = None
        self._seconds = 0.001
        with suppress(OSError, AttributeError):
            self._descriptor = os.pidfd_open(pid)
            self._ended = select.poll()
            self._ended.register(self._descriptor, select.POLLIN)

    def pause(self) -> None:
        """Wait a moment."""
        if self._descriptor is not None:
            self._ended.poll(1000 * LONGEST_PAUSE)
        else:
            time.sleep(self._seconds)
            self._seconds = min(2 * self._seconds, LONGEST_PAUSE)

    def close(self) -> None:
        """Free the descriptor."""
        if self._descriptor is not None:
            os.close(self._descriptor)


def _has_exited(pid: int) -> bool:
    """Tell whether our child has ended, without taking its status: its group number stays taken until then."""
    return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def scene_environment(job: Job) -> dict[str, str]:
    """Return the variables of a scene's processes; what the user has set wins."""
    return {**job.environment, **os.environ, **own_code()}


def start_scene(job: Job, log: int) -> Process:
    """Start a scene in a process group of its own, which writes to the descriptor `log`."""
    return subprocess.Popen(
        [sys.executable, "-I", "-S", str(LAUNCHER), str(os.getpid()), *job.command],
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        start_new_session=True,
        env=scene_environment(job),
    )


def _watch(job: Job, process: Process, cancelled: Callable[[], bool]) -> _Watched:
    """Wait for the end of a scene, and bring it about at a limit."""
    watched = _Watched()
    begun = time.monotonic()
    next_sample, kill_at, grace = begun, None, job.grace
    with closing(_Pauses(process.pid)) as pauses:
        while not _has_exited(process.pid):
            now = time.monotonic()
            if now >= next_sample:
                memory = resident_memory(process.pid)
                watched.peak_memory = max(watched.peak_memory, memory)
                next_sample = now + min(SAMPLE_INTERVAL, now - begun)  # short scenes are looked at more often
            else:
                memory = 0
            if kill_at is None:
                if cancelled():
                    watched.stopped_by = "interrupted"
                elif job.time_limit is not None and now - begun > job.time_limit:
                    watched.stopped_by = "time limit"
                elif job.memory_limit is not None and memory > job.memory_limit:
                    watched.stopped_by, grace = "memory limit", min(job.grace, MEMORY_GRACE)
                if watched.stopped_by is not None:
                    signal_group(process.pid, signal.SIGTERM)
                    kill_at = now + grace
            elif now > kill_at:
                signal_group(process.pid, signal.SIGKILL)
            pauses.pause()
    signal_group(process.pid, signal.SIGKILL)  # what it started and left behind
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = watched.status = os.waitstatus_to_exitcode(status)
    watched.processor_seconds = usage.ru_utime + usage.ru_stime  # with those of the steps, for which it waited
    # A spike between two looks shows in the largest process at least [KiB]. The figure begins with what this process
    # held when it forked, so it says something only above our own peak.
    if usage.ru_maxrss > resource.getrusage(resource.RUSAGE_SELF).ru_maxrss:
        watched.peak_memory = max(watched.peak_memory, usage.ru_maxrss * 1024)
    return watched


def _stop_at_once(process: Process, grace: float) -> None:
    """Whatever has interrupted the watching: no scene stays behind."""
    signal_group(process.pid, signal.SIGTERM)
    deadline = time.monotonic() + grace
    while not _has_exited(process.pid) and time.monotonic() < deadline:
        time.sleep(LONGEST_PAUSE)
    signal_group(process.pid, signal.SIGKILL)
    process.wait()


def _describe(job: Job, watched: _Watched, follower: LogFollower) -> tuple[Outcome, int, str]:
    """Return outcome, exit code and reason."""
    if watched.stopped_by == "time limit":
        return "time limit", MACHINE_FAILED, f"ran longer than {format_seconds(job.time_limit or 0)}"
    if watched.stopped_by == "memory limit":
        text = f"took {format_bytes(watched.peak_memory)}, the limit is {format_bytes(job.memory_limit or 0)}"
        return "memory limit", MACHINE_FAILED, text
    outcome, code = classify(watched.status)
    if outcome == "done":
        return outcome, code, ""
    number = signal_of(watched.status)
    if number is not None:
        text = f"died of {signal_name(number)}"
        if number == signal.SIGKILL:
            text += " (the kernel does that when memory runs out)"
        return outcome, code, text
    if follower.error is None and outcome == "machine failure":  # which says why, where its log has room
        free = format_bytes(free_bytes(Path(job.folder)))
        return outcome, code, f"its log ends before the reason, {free} are free at {job.folder}: was the disk full?"
    return outcome, code, follower.error or follower.last_line or f"exit code {code} and not a word"


def run_scene(job: Job, cancelled: Callable[[], bool] = lambda: False, host: str = "") -> SceneResult | None:
    """Run a scene to its end, within its limits, and send what it made to the storage. Returns None when it was
    stopped because `cancelled()` said so.

    The machine's refusals (a disk that is full or read-only) are results too; nothing is raised for them.
    """
    result = run_processes(job, cancelled, host)
    return None if result is None else stored(job, result)


def run_processes(
    job: Job,
    cancelled: Callable[[], bool] = lambda: False,
    host: str = "",
    start: Callable[[Job, int], Process] = start_scene,
) -> SceneResult | None:
    """Run a scene as `run_scene` does, without the storage; `start(job, log)` starts it."""
    started, begun = datetime.now(UTC), time.monotonic()
    folder = Path(job.folder)
    identity = {
        "job": job.name,
        "scene": job.scene,
        "parameters": job.parameters,
        "seed": job.seed,
        "fingerprint": job.fingerprint,
        "host": host or this_host(),
        "started": started.isoformat(timespec="milliseconds"),
    }
    record = folder / PROCESS_NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        end_leftover(folder, job.grace)
        log = os.open(folder / LOG_NAME, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            os.write(log, f"# {identity['started']} {identity['host']}\n# {shlex.join(job.command)}\n".encode())
            position = os.fstat(log).st_size
            process = start(job, log)
            try:
                if job.address_space is not None:
                    with suppress(psutil.Error):
                        psutil.Process(process.pid).rlimit(psutil.RLIMIT_AS, (job.address_space, job.address_space))
                record.write_text(
                    json.dumps({"group": process.pid, "created": created_at(process.pid) or 0.0, "host": this_host()})
                )
                watched = _watch(job, process, cancelled)
            except BaseException:
                _stop_at_once(process, job.grace)
                raise
            finally:
                record.unlink(missing_ok=True)
            if watched.stopped_by is not None:
                os.write(log, f"# stopped: {watched.stopped_by}\n".encode())
        finally:
            os.close(log)
    except OSError as error:
        return SceneResult.model_validate(
            identity
            | {
                "outcome": "machine failure",
                "exit_code": MACHINE_FAILED,
                "reason": clean(f"{error.filename or folder}: {error.strerror or error}"),
                "seconds": round(time.monotonic() - begun, 3),
            }
        )
    if watched.stopped_by == "interrupted":
        return None
    follower = LogFollower(folder / LOG_NAME, job.steps, position)
    follower.look(final=True)
    outcome, code, reason = _describe(job, watched, follower)
    steps = job.steps
    if outcome != "done":
        reached = steps.index(follower.step) if follower.step is not None else 0
        steps = steps[: reached + (outcome == "not ok")]
    written = manifests(folder, steps)
    failed_step = None if outcome == "done" else follower.step
    if outcome == "not ok":  # the chain may have gone on after it
        failed_step = next((step for step, manifest in written.items() if manifest.outcome != "ok"), failed_step)
    return SceneResult.model_validate(
        identity
        | {
            "measures": measures(folder, written),
            "outcome": outcome,
            "exit_code": code,
            "failed_step": failed_step,
            "reason": reason,
            "seconds": round(time.monotonic() - begun, 3),
            "peak_memory_bytes": watched.peak_memory,
            "processor_seconds": round(watched.processor_seconds, 3),
            "artifact_bytes": sum(file.bytes for manifest in written.values() for file in manifest.files),
            "artifacts": {step: manifest.content_digest for step, manifest in written.items()},
            "outcomes": {step: manifest.outcome for step, manifest in written.items() if manifest.outcome != "ok"},
        }
    )


def stored(job: Job, result: SceneResult) -> SceneResult:
    """Send what a scene made to the storage of its batch, where it has one; return its result with what came of it."""
    if job.storage is None:
        return result
    begun, folder = time.monotonic(), Path(job.folder)
    changes: dict[str, object] = {}
    try:
        send(folder, tuple(result.artifacts), job.storage, job.storage_timeout)
        if result.outcome == "done" and not job.keep:
            drop_local(folder, job.steps)
    except ScenewrightError as error:
        changes = {"outcome": "machine failure", "exit_code": MACHINE_FAILED, "reason": clean(error.message)}
    return result.model_copy(update={"seconds": round(result.seconds + time.monotonic() - begun, 3), **changes})

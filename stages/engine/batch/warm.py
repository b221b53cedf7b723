"""Scenes by workers that keep libraries and networks' code in memory between scenes ([executor] warm = true).

Each thread that runs scenes has a worker of its own (warm_worker.py). One that dies, or is killed, takes its scene with
it, which then runs as if there were no worker; the next scene gets a new one.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress

from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scene_run import LAUNCHER, run_scene, scene_environment, stored

WORKER = "scenewright.stages.engine.batch.warm_worker"
SECONDS_BETWEEN_LOOKS = 0.25
"""Time between two looks at a waiting worker [s]."""
PATIENCE = 5.0
"""Time beyond the grace of a scene that a worker gets to stop when it is asked to [s]."""


class _Died(Exception):
    """The worker gave no answer."""


class _Worker:
    """One process, and what it was started for."""

    def __init__(self, environment: dict[str, str]) -> None:
        self.environment = environment
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(LAUNCHER), str(os.getpid()), sys.executable, "-m", WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env=environment,
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._requests, self._answers = self._process.stdin, self._process.stdout

    def run(self, job: Job, cancelled: Callable[[], bool], host: str) -> SceneResult | None:
        """Run a scene, the storage left out. Raises _Died."""
        local_job = job.model_copy(update={"storage": None})
        try:
            self._requests.write(json.dumps({"job": local_job.model_dump(mode="json"), "host": host}).encode() + b"\n")
            self._requests.flush()
            answer = self._answer(cancelled)
        except OSError:
            raise _Died from None
        except BaseException:  # whatever has interrupted the waiting: no scene stays behind
            self._process.send_signal(signal.SIGTERM)
            with suppress(_Died, OSError):
                self._answer(lambda: True, patience=job.grace + PATIENCE)
            raise
        return None if answer is None else SceneResult.model_validate(answer)

    def _answer(self, cancelled: Callable[[], bool], patience: float | None = None) -> dict[str, object] | None:
        waiting = select.poll()
        waiting.register(self._answers, select.POLLIN)
        waited, text = 0.0, b""
        while not text.endswith(b"\n"):
            if waiting.poll(1000 * SECONDS_BETWEEN_LOOKS):
                received = os.read(self._answers.fileno(), 2**16)
                if not received:
                    raise _Died
                text += received
                continue
            waited += SECONDS_BETWEEN_LOOKS
            if cancelled():
                self._process.send_signal(signal.SIGTERM)
            if patience is not None and waited > patience:
                raise _Died
        return json.loads(text)

    def close(self) -> None:
        """End the process."""
        with suppress(OSError):
            self._requests.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._answers.close()


class WarmScenes:
    """Runs scenes like `run_scene`, each thread with a worker."""

    def __init__(self) -> None:
        self._local = threading.local()
        self._all: list[_Worker] = []

    def __call__(self, job: Job, cancelled: Callable[[], bool] = lambda: False, host: str = "") -> SceneResult | None:
        """Run a scene to its end, within its limits, and send what it made to the storage (scene_run.py)."""
        worker, environment = getattr(self._local, "worker", None), scene_environment(job)
        if worker is not None and worker.environment != environment:  # numeric libraries look at it when they load
            self._drop(worker)
            worker = None
        if worker is None:
            worker = self._local.worker = _Worker(environment)
            self._all.append(worker)
        try:
            result = worker.run(job, cancelled, host)
        except _Died:
            self._drop(worker)
            return run_scene(job, cancelled, host)
        return None if result is None else stored(job, result)

    def _drop(self, worker: _Worker) -> None:
        self._local.worker = None
        self._all.remove(worker)
        worker.close()

    def close(self) -> None:
        """End all workers; nothing may be running."""
        for worker in self._all:
            worker.close()
        self._all.clear()

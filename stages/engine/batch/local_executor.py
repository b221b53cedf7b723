"""Scenes as process groups on this machine, so many at once."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scene_run import run_scene
from scenewright.stages.engine.batch.warm import WarmScenes

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)
"""Environment variables that limit the threads of numeric libraries. No digest depends on them."""


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_environment(threads: int) -> dict[str, str]:
    """Return the variables that give a scene so many threads; what the user has set wins (scene_run.py)."""
    return dict.fromkeys(THREAD_VARIABLES, str(threads))


class LocalExecutor:
    """Runs `jobs` scenes at once; each gets its share of the processors, so that they do not fight for them."""

    def __init__(
        self,
        jobs: int,
        threads: int | None = None,
        run: Callable[[Job, Callable[[], bool]], SceneResult | None] = run_scene,
        *,
        warm: bool = False,
    ) -> None:
        self._jobs = jobs
        self._warm = WarmScenes() if warm else None
        self._run = self._warm or run
        self._environment = thread_environment(threads or max(1, processors() // jobs))
        self._stop = threading.Event()
        # A scene dies with the thread that started it (launcher.py); threads of a pool live until close().
        self._pool = ThreadPoolExecutor(max_workers=jobs, thread_name_prefix="scene")
        self._ended: queue.SimpleQueue[Future[SceneResult | None]] = queue.SimpleQueue()

    def capacity(self) -> int:
        """Return the number of scenes at once."""
        return self._jobs

    def submit(self, job: Job) -> None:
        """Start a job in its own process group, at once if a thread is free."""
        job = job.model_copy(update={"environment": {**self._environment, **job.environment}})
        self._pool.submit(self._run, job, self._stop.is_set).add_done_callback(self._ended.put)

    def completed(self, timeout: float) -> list[SceneResult]:
        """Return the results of the jobs that ended; an error of ours in the running of a scene is raised here."""
        futures = []
        try:
            futures.append(self._ended.get(timeout=timeout))
            while True:
                futures.append(self._ended.get_nowait())
        except queue.Empty:
            pass
        ended = (future.result() for future in futures if not future.cancelled())
        return [result for result in ended if result is not None]

    def cancel(self) -> None:
        """Stop all running scenes; waiting ones are forgotten."""
        self._stop.set()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def close(self) -> None:
        """End the threads and their workers."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        if self._warm is not None:
            self._warm.close()

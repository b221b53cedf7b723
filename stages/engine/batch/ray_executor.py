"""Scenes on a Ray cluster: each a task that runs the scene's processes on some node. Needs the extra `cluster`.

Inputs and outputs travel by path: every node has to see the data, the batch folder and this repository at the same
place. A node that goes away costs its scenes only; they are handed out again.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from types import ModuleType
from typing import Any

from scenewright.schemas.errors import MachineFailure, MissingDependency, UsageError
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.local_executor import thread_environment
from scenewright.stages.engine.batch.outcomes import MACHINE_FAILED
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scene_log import clean
from scenewright.stages.engine.batch.scene_run import run_scene, this_host
from scenewright.stages.engine.batch.spec import RayOptions
from scenewright.stages.engine.batch.warm import WarmScenes
from scenewright.stages.engine.own_code import own_code

CANCEL_PATIENCE = 5.0
"""Added to the grace of the scenes when the cluster is asked to stop them [s]."""


def load_ray() -> ModuleType:
    """Import Ray. Raises MissingDependency with what to install."""
    try:
        import ray
    except ImportError:
        raise MissingDependency(
            "the ray executor needs Ray", hint="pip install 'scenewright[cluster]', or [executor] kind = \"local\""
        ) from None
    return ray


@cache
def warm_scenes() -> WarmScenes:
    """Return what runs scenes in this process of Ray's, which takes one task after another."""
    return WarmScenes()


def run_on_worker(job_json: str, warm: bool = False) -> str | None:
    """Run one scene; this is the body of the Ray task. Job and result travel as JSON."""
    node = load_ray().get_runtime_context().get_node_id()
    run = warm_scenes() if warm else run_scene
    result = run(Job.model_validate_json(job_json), host=f"{this_host()}/{node[:8]}")
    return None if result is None else result.model_dump_json()


def fitting(node: Mapping[str, float], wanted: Mapping[str, float]) -> int:
    """Return how many scenes with resources `wanted` fit on a node with resources `node` at once."""
    return min((int(node.get(name, 0.0) / amount + 1e-9) for name, amount in wanted.items()), default=0)


class RayExecutor:
    """Hands scenes to a cluster and takes lost ones back."""

    def __init__(self, options: RayOptions, memory_limit: int | None = None, runtime: ModuleType | None = None) -> None:
        """Connect to the cluster. Raises MissingDependency, MachineFailure, or UsageError when no node fits a scene."""
        self._ray: Any = runtime or load_ray()
        self._options = options
        self._resources = {"CPU": options.cpus, **options.resources}
        memory = options.memory or memory_limit
        if memory is not None:
            self._resources["memory"] = float(memory)
        self._jobs: dict[Any, Job] = {}
        self._lost: dict[str, list[str]] = {}
        self._stopping = False
        self._connected_here = not self._ray.is_initialized()
        if self._connected_here:
            self._connect()
        if not self.capacity():
            self.close()
            requested = ", ".join(f"{name} {amount:g}" for name, amount in self._resources.items())
            raise UsageError(
                f"no node of the cluster offers what a scene asks for: {requested}", hint="lower [executor]"
            )
        self._task = self._ray.remote(run_on_worker).options(
            num_cpus=options.cpus,
            memory=memory,
            resources=dict(options.resources),
            max_retries=0,  # lost scenes are counted and recorded here, which Ray's own retries would hide
            scheduling_strategy="SPREAD",
            runtime_env={"env_vars": own_code()},
        )

    def _connect(self) -> None:
        address = self._options.address
        try:
            self._ray.init(address=address, log_to_driver=False, logging_level="warning", configure_logging=False)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise MachineFailure(
                f"no Ray cluster at {address!r}: {clean(str(error))}", hint="start one, or give [executor] address"
            ) from None

    def capacity(self) -> int:
        """Return how many scenes fit on the nodes that are alive, and one more so that none waits for us."""
        total = sum(fitting(node["Resources"], self._resources) for node in self._ray.nodes() if node["Alive"])
        if not total:
            return 0
        return min(total + 1, self._options.jobs) if self._options.jobs else total + 1

    def submit(self, job: Job) -> None:
        """Hand a scene to the cluster; its numeric libraries get as many threads as it has processors."""
        threads = thread_environment(max(1, int(self._options.cpus)))
        job = job.model_copy(update={"environment": {**threads, **job.environment}})
        self._jobs[self._task.remote(job.model_dump_json(), self._options.warm)] = job

    def completed(self, timeout: float) -> list[SceneResult]:
        """Return results; scenes whose worker was lost go back to the cluster, up to `retries` times each."""
        if not self._jobs:
            time.sleep(timeout)
            return []
        ready, _ = self._ray.wait(list(self._jobs), num_returns=1, timeout=timeout)
        if ready:
            ready_now, _ = self._ray.wait(list(self._jobs), num_returns=len(self._jobs), timeout=0)
            ready = list(dict.fromkeys([*ready, *ready_now]))
        results = [self._take(reference) for reference in ready]
        return [result for result in results if result is not None]

    def _take(self, reference: Any) -> SceneResult | None:
        job = self._jobs.pop(reference)
        errors = self._ray.exceptions
        try:
            text = self._ray.get(reference)
        except errors.TaskCancelledError:
            return None
        except errors.RayTaskError as error:
            return self._without_result(job, "crash", 1, clean(f"the worker failed: {error.cause!r}"))
        except errors.RayError as error:
            if self._stopping:
                return None
            lost = self._lost.setdefault(job.name, [])
            lost.append(clean(f"{type(error).__name__}: {error}"))
            if len(lost) > self._options.retries:
                return self._without_result(
                    job, "lost worker", MACHINE_FAILED, f"its worker was lost {len(lost)} times"
                )
            self.submit(job)
            return None
        if text is None:
            return None
        lost = self._lost.get(job.name, [])
        result = SceneResult.model_validate_json(text)
        return result.model_copy(update={"attempts": 1 + len(lost), "lost": tuple(lost)})

    def _without_result(self, job: Job, outcome: str, exit_code: int, reason: str) -> SceneResult:
        lost = self._lost.get(job.name, [])
        return SceneResult.model_validate(
            {
                "job": job.name,
                "scene": job.scene,
                "parameters": job.parameters,
                "seed": job.seed,
                "fingerprint": job.fingerprint,
                "outcome": outcome,
                "exit_code": exit_code,
                "reason": reason,
                "seconds": 0.0,
                "started": datetime.now(UTC).isoformat(timespec="milliseconds"),
                "attempts": max(1, len(lost)),
                "lost": tuple(lost),
            }
        )

    def cancel(self) -> None:
        """Interrupt all scenes; the workers end their processes (scene_run.py). Waits for that, within reason."""
        self._stopping = True
        references = list(self._jobs)
        for reference in references:
            self._ray.cancel(reference)
        if references:
            patience = CANCEL_PATIENCE + max(job.grace for job in self._jobs.values())
            self._ray.wait(references, num_returns=len(references), timeout=patience)

    def close(self) -> None:
        """Leave the cluster, if it was joined here."""
        if self._connected_here and self._ray.is_initialized():
            self._ray.shutdown()

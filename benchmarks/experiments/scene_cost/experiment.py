"""What a scene costs: stretches of logs over a Ray cluster with storage and a killed node, and on this machine.

Cluster: short stretches of three logs (two recorded, one rendered), each to the graph of its room by the pipeline
`short_logs.toml`, on three nodes of one processor each on this machine with warm workers; what scenes make goes to an
S3 server of this machine (a process of its own), and nothing stays in the batch's own folder. One node is killed while
a scene runs on it. Every scene has to end well, whole in the storage, with the digests that the same scenes have
without cluster, storage and kill. Some of the scenes run without warm workers too. A run that was stopped goes on.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.batch.expansion import Batch, read_batch
from scenewright.stages.engine.batch.local_executor import LocalExecutor
from scenewright.stages.engine.batch.ray_executor import RayExecutor, load_ray
from scenewright.stages.engine.batch.results import RESULTS_NAME, SceneResult, latest_by_job, read_results
from scenewright.stages.engine.batch.scene_run import PROCESS_NAME
from scenewright.stages.engine.batch.session import run_batch
from scenewright.stages.engine.batch.spec import RayOptions
from scenewright.stages.engine.batch.storage import stored_digest
from scenewright.stages.engine.reading import read_manifest
from scenewright.stages.engine.runner import PROCESSOR
from scenewright.stages.engine.store import TIMINGS_NAME
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, mean
from benchmarks.tabulation import Figure

NODES = 3
PATIENCE = 3600.0
"""How long the killer waits for its moment [s]."""
LOGS = {
    "kitchen": ("7scenes_redkitchen", 500),
    "livingroom": ("redwood_livingroom1", 211),
    "office": ("hololens_office", 187),
}
"""Folder and frames of each log; every second scene is of the kitchen."""
SPAN, EVERY = 12, 2
"""Frames of a log that a scene spans, and the step between those that it uses: six frames."""
COLD = 10
"""Scenes that run without warm workers too."""
BUCKET = "scenes"
ARMS = {"cold": "a process a step", "warm": "warm workers", "cluster": "warm workers on the cluster"}
PIPELINE = Path(__file__).with_name("short_logs.toml")


STEPS = {"ingest": "sequence", "segment": "segments", "fuse": "panoptic_map", "graph": "contact_graph"}
"""Step of the pipeline -> its artifact."""
BESIDE = "beside the steps"
FEW, MANY = "few", "many"
"""Cases: on this machine alone; on the cluster."""


class SceneParameters(Parameters):
    """Options of the experiment."""

    logs: Path = Field(Path("../shared/data"), description="Folder of the recorded logs")
    scenes: int = Field(200, ge=1, description="Stretches of logs on the cluster")


def stretches(scenes: int) -> list[tuple[str, str, int]]:
    """Return name, log folder and first frame of every scene: spread evenly over each log, no two alike."""
    names = ["kitchen" if k % 2 == 0 else ("livingroom", "office")[k // 2 % 2] for k in range(scenes)]
    found = []
    for log, (folder, frames) in LOGS.items():
        count = names.count(log)
        if count > frames - SPAN:
            raise UsageError(f"{scenes} scenes: {folder} has not as many different stretches", hint="ask for fewer")
        starts = [k * (frames - SPAN) // max(1, count - 1) for k in range(count)]
        found += [(f"{log}-{start:03d}", folder, start) for start in starts]
    return found


def batch_file(folder: Path, logs: Path, scenes: list[tuple[str, str, int]], storage: str = "") -> Batch:
    """Write and read a batch file of the scenes; `storage` is a table of it."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f'pipeline = "{PIPELINE}"', f'[set]\nevery = "{EVERY}"', storage]
    for name, log, start in scenes:
        values = f'log = "{(logs / log).resolve()}", start = {start}, stop = {start + SPAN}'
        lines.append(f'[[scene]]\nname = "{name}"\nset = {{ {values} }}')
    (folder / "batch.toml").write_text("\n".join(lines))
    return read_batch(folder / "batch.toml")


@contextmanager
def s3_server() -> Iterator[str]:
    """An S3 server as a process of this machine; the variables by which clients find it are set. Yields a URL in it."""
    import s3fs

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    os.environ |= {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": "key",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    try:
        for _ in range(100):
            with socket.socket() as asking:
                if asking.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.2)
        s3fs.S3FileSystem().mkdir(BUCKET)
        yield f"s3://{BUCKET}/logs"
    finally:
        server.terminate()
        server.wait()


def scenes_of(bench: Bench, case: str) -> list[tuple[str, str, int]]:
    """Return the scenes of a case: all stretches, or COLD of them, evenly."""
    wanted = stretches(bench.parameters.scenes)
    return wanted if case == MANY else wanted[:: max(1, len(wanted) // COLD)]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Run the scenes of a case warm, and cold or on the cluster with a killed node; compare; yield what each cost."""
    case = trials[0].case
    folder, logs, scenes = bench.out / "runs" / case, bench.parameters.logs, scenes_of(bench, case)
    found = {"warm": _run_here(batch_file(folder / "warm", logs, scenes), folder / "warm", warm=True)}
    if case == MANY:
        found["cluster"] = _stored(folder / "cluster", logs, scenes)
    else:
        found["cold"] = _run_here(batch_file(folder / "cold", logs, scenes), folder / "cold", warm=False)
    for arm, results in found.items():
        _refuse_differences(results, found["warm"], arm)
    for trial in trials:
        result = found[trial.arm][trial.seed]
        yield trial, _cost(result) | (_by_step(folder / trial.arm, result) if case == FEW else {})


def _stored(folder: Path, logs: Path, scenes: list[tuple[str, str, int]]) -> dict[str, SceneResult]:
    """Run scenes on the cluster. Raises RuntimeError unless all are whole in the storage."""
    with s3_server() as url:
        found = _run_on_cluster(batch_file(folder, logs, scenes, f'[storage]\nurl = "{url}"\nkeep = false'), folder)
        for name, result in found.items():
            for step, digest in result.artifacts.items():
                if stored_digest(f"{url}/{name}", step, 60.0) != digest:
                    raise RuntimeError(f"{name}: {step} is not whole in the storage")
    return found


def _run_here(batch: Batch, folder: Path, *, warm: bool) -> dict[str, SceneResult]:
    run_batch(batch, folder / "out", executor=LocalExecutor(1, 1, warm=warm), say=_say)
    return _all_done(batch, folder)


def _run_on_cluster(batch: Batch, folder: Path) -> dict[str, SceneResult]:
    from ray.cluster_utils import Cluster

    out = folder / "out"
    os.environ["RAY_worker_niceness"] = "0"  # noqa: SIM112 (Ray's is 15: beside other work its scenes would hardly run)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    ended = threading.Event()
    try:
        for _ in range(NODES - 1):
            cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        killer = threading.Thread(target=_kill_a_node, args=(cluster, out, len(batch.runs), ended), daemon=True)
        killer.start()
        options = RayOptions(kind="ray", address=cluster.address, warm=True)
        run_batch(batch, out, executor=RayExecutor(options), say=_say)
    finally:
        ended.set()
        load_ray().shutdown()
        cluster.shutdown()
    return _all_done(batch, folder)


def _all_done(batch: Batch, folder: Path) -> dict[str, SceneResult]:
    found = latest_by_job(read_results(folder / "out" / RESULTS_NAME))
    missing = [run.name for run in batch.runs if run.name not in found or found[run.name].outcome != "done"]
    if missing:
        raise RuntimeError(f"{len(missing)} scenes did not end well, {missing[0]} for one; see {folder}/out/summary.md")
    return {run.name: found[run.name] for run in batch.runs}


def _refuse_differences(found: dict[str, SceneResult], warm: dict[str, SceneResult], where: str) -> None:
    for name, result in found.items():
        if result.artifacts != warm[name].artifacts:
            raise RuntimeError(f"{name}: {where}: other digests than in a warm worker of this machine")


def _cost(result: SceneResult) -> dict[str, float]:
    return {
        "core-seconds": result.processor_seconds,
        "megabytes": result.artifact_bytes / 1e6,
        "memory": result.peak_memory_bytes / 1e6,
        "lost": float(result.lost),
    }


def _by_step(folder: Path, result: SceneResult) -> dict[str, float]:
    """Return processor time and bytes of every step, and what runs the steps takes beside them."""
    costs: dict[str, float] = {}
    for step, name in STEPS.items():
        artifact = folder / "out" / result.scene / name
        costs[f"{step}/core-seconds"] = json.loads((artifact / TIMINGS_NAME).read_text())[PROCESSOR]
        costs[f"{step}/megabytes"] = sum(file.bytes for file in read_manifest(artifact).files) / 1e6
    beside = result.processor_seconds - sum(costs[f"{step}/core-seconds"] for step in STEPS)
    return costs | {f"{BESIDE}/core-seconds": beside}


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _kill_a_node(cluster: Any, out: Path, scenes: int, ended: threading.Event) -> None:
    """Kill a node besides the head on which a scene runs, when half of the scenes have ended."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and not ended.wait(0.2):
        if len(read_results(out / RESULTS_NAME)) < scenes // 2:
            continue
        heads = [
            line.split()[-1]
            for record in out.glob(f"*/{PROCESS_NAME}")
            for line in (record.parent / "batch.log").read_text().splitlines()
            if line.startswith("# 2")
        ]
        for node in cluster.list_all_nodes():
            if node.node_id != cluster.head_node.node_id and any(h.endswith(node.node_id[:8]) for h in heads):
                cluster.remove_node(node, allow_graceful=False)
                return


def part_of(step: str) -> Callable[[Mapping[str, float]], dict[str, float] | None]:
    """Return what picks the costs of a step out of those of a scene; None where they are not known."""
    return lambda record: (
        {name: record[f"{step}/{name}"] for name in ("core-seconds", "megabytes") if f"{step}/{name}" in record} or None
    )


def most(name: str) -> Callable[[Sequence[Mapping[str, float]]], float | None]:
    """Return a figure: the largest entry of that name."""
    return lambda records: max((record[name] for record in records if name in record), default=None)


def whole(record: Mapping[str, float]) -> Mapping[str, float] | None:
    """Return the costs of a scene; None of one that was lost with its node, and ran twice."""
    return None if record["lost"] else record


def hundred_thousand(results: Results) -> Mapping[str, Figure | None]:
    """Return core-hours and terabytes of a hundred thousand scenes."""
    figures: dict[str, Figure | None] = {}
    for case, arm in ((shown, arm) for shown in ("all", MANY) for arm in results.arms(shown)):
        seconds, size = (results.value(arm, case, name) or 0.0 for name in ("core-seconds", "megabytes"))
        count = len(results.of(arm, case))
        figures[f"{arm}/{case}/hundred thousand"] = Figure(1e5 * seconds / 3600, None, None, count, "core-hours")
        figures[f"{arm}/{case}/hundred thousand on disk"] = Figure(1e5 * size / 1e6, None, None, count, "TB")
    return figures


EXPERIMENT = Experiment(
    name="scene_cost",
    title="What a scene costs on a cluster with storage",
    simulated="The living room's pictures are rendered; the kitchen and the office are recorded.",
    knows="Exact poses of the logs.",
    does_not_show="Scenes of a user's size: six frames each, to the graph of the room by geometry alone. A network "
    "between machines: nodes and storage share this one. The processor time of Ray, of the storage, and of loading "
    "libraries once a worker, is not in it. One node is killed, once.",
    arms=ARMS,
    cases=(FEW, MANY),
    seeds_of=lambda bench, case: [name for name, _, _ in scenes_of(bench, case)],
    runs=lambda arm, case: (arm == "cluster") == (case == MANY),
    together=lambda trial: trial.case,
    measure=measure,
    record=dict[str, float],
    measures={
        "core-seconds": mean("core-seconds", "s", interval=False),
        "megabytes": mean("megabytes", "MB", interval=False),
        "memory": Measure(most("memory"), "MB", interval=False),
    },
    parameters=SceneParameters,
    places=frozenset({"logs"}),
    quick={"scenes": 8},
    steps=tuple(STEPS),
    subcases={step: (FEW, part_of(step)) for step in (*STEPS, BESIDE)} | {"all": (FEW, whole), MANY: (MANY, whole)},
    more_figures=hundred_thousand,
)

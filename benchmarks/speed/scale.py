"""What many scenes cost: stretches of logs over a Ray cluster with storage and a killed node; batches without work.

    python -m benchmarks.speed.scale --out FOLDER [--logs FOLDER] [--scenes N] [--simulated N ...]

Cluster: short stretches of three logs (two recorded, one rendered), each to the graph of its room by the pipeline
`short_logs.toml`, on three nodes of one processor each on this machine with warm workers; what scenes make goes to an
S3 server of this machine (a process of its own), and nothing stays in the batch's own folder. One node is killed while
a scene runs on it. Every scene has to end well, whole in the storage, with the digests that the same scenes have
without cluster, storage and kill. Some of the scenes run without warm workers too. Simulated: batches whose scenes end
at once: what a scene costs beside its steps, as batches grow. A run that was stopped goes on from FOLDER.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
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
from scenewright.stages.kit.measurement.tables import Table, as_markdown

from benchmarks.options import Measurement, asked
from benchmarks.results import write_measured
from benchmarks.speed.batch import measure_scheduler

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
PIPELINE = Path(__file__).with_name("short_logs.toml")


class ScaleMeasurement(Measurement):
    """Options of the measurement."""

    logs: Path = Field(Path("../shared/data"), description="Folder of the recorded logs")
    scenes: int = Field(200, ge=0, description="Stretches of logs on the cluster")
    simulated: tuple[int, ...] = Field((100, 1000, 10_000), description="Sizes of batches without work")


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


def measure_cluster(folder: Path, logs: Path, scenes: int) -> dict[str, float]:
    """Run the scenes here and on the cluster, kill a node, compare; return what a scene cost."""
    wanted = stretches(scenes)
    cold = _run_here(batch_file(folder / "cold", logs, wanted[:: max(1, scenes // COLD)]), folder / "cold", warm=False)
    warm = _run_here(batch_file(folder / "warm", logs, wanted), folder / "warm", warm=True)
    _refuse_differences(cold, warm, "cold")
    with s3_server() as url:
        storage = f'[storage]\nurl = "{url}"\nkeep = false'
        found, seconds = _run_on_cluster(batch_file(folder / "cluster", logs, wanted, storage), folder / "cluster")
        _refuse_differences(found, warm, "on the cluster")
        for name, result in found.items():
            for step, digest in result.artifacts.items():
                if stored_digest(f"{url}/{name}", step, 60.0) != digest:
                    raise RuntimeError(f"{name}: {step} is not whole in the storage")
    first = [result for result in found.values() if not result.lost]
    again = {name: warm[name] for name in cold}
    return {
        "cluster/scenes": scenes,
        "cluster/lost": len(found) - len(first),
        "cluster/wall_s": seconds,
        **_costs("cluster", first),
        **_costs("cold", list(cold.values())),
        **_costs("warm", list(again.values())),
        **_by_step("cold", folder / "cold", cold),
        **_by_step("warm", folder / "warm", again),
    }


def _run_here(batch: Batch, folder: Path, *, warm: bool) -> dict[str, SceneResult]:
    run_batch(batch, folder / "out", executor=LocalExecutor(1, 1, warm=warm), say=_say)
    return _all_done(batch, folder)


def _run_on_cluster(batch: Batch, folder: Path) -> tuple[dict[str, SceneResult], float]:
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
        began = time.perf_counter()
        options = RayOptions(kind="ray", address=cluster.address, warm=True)
        run_batch(batch, out, executor=RayExecutor(options), say=_say)
        seconds = time.perf_counter() - began
    finally:
        ended.set()
        load_ray().shutdown()
        cluster.shutdown()
    return _all_done(batch, folder), seconds


def _all_done(batch: Batch, folder: Path) -> dict[str, SceneResult]:
    found = latest_by_job(read_results(folder / "out" / RESULTS_NAME))
    missing = [run.name for run in batch.runs if run.name not in found or found[run.name].outcome != "done"]
    if missing:
        raise RuntimeError(f"{len(missing)} scenes did not end well, {missing[0]} for one; see {folder}/out/summary.md")
    return {run.name: found[run.name] for run in batch.runs}


def _refuse_differences(found: dict[str, SceneResult], warm: dict[str, SceneResult], where: str) -> None:
    for name, result in found.items():
        if result.artifacts != warm[name].artifacts:
            raise RuntimeError(f"{name}: other digests {where} than in a warm worker of this machine")


def _costs(name: str, results: list[SceneResult]) -> dict[str, float]:
    processor = [result.processor_seconds for result in results]
    return {
        f"{name}/measured": len(results),
        f"{name}/processor_s": statistics.mean(processor),
        f"{name}/processor_median_s": statistics.median(processor),
        f"{name}/processor_most_s": max(processor),
        f"{name}/megabytes": statistics.mean(result.artifact_bytes / 1e6 for result in results),
        f"{name}/memory_mb": max(result.peak_memory_bytes / 1e6 for result in results),
    }


def _by_step(name: str, folder: Path, results: dict[str, SceneResult]) -> dict[str, float]:
    """Mean processor time and bytes of every step, and of what runs the steps."""
    seconds: dict[str, list[float]] = {}
    sizes: dict[str, list[float]] = {}
    for scene, result in results.items():
        for step in result.artifacts:
            artifact = folder / "out" / scene / step
            manifest = read_manifest(artifact)
            seconds.setdefault(step, []).append(json.loads((artifact / TIMINGS_NAME).read_text())[PROCESSOR])
            sizes.setdefault(step, []).append(sum(file.bytes for file in manifest.files) / 1e6)
    steps = {step: statistics.mean(values) for step, values in seconds.items()}
    beside = statistics.mean(result.processor_seconds for result in results.values()) - sum(steps.values())
    return {
        **{f"{name}/{step}/processor_s": value for step, value in steps.items()},
        **{f"{name}/{step}/megabytes": statistics.mean(values) for step, values in sizes.items()},
        f"{name}/beside the steps/processor_s": beside,
    }


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


def measure(folder: Path, logs: Path, scenes: int, simulated: tuple[int, ...]) -> dict[str, float]:
    """Return all figures; what the scenes made is kept in `folder`."""
    metrics: dict[str, float] = {}
    for count in simulated:
        empty = Path(tempfile.mkdtemp())
        try:
            found = measure_scheduler(empty, count)
        finally:
            shutil.rmtree(empty)
        metrics |= {f"simulated/{count}/{name.split('/')[1]}": value for name, value in found.items()}
        metrics[f"simulated/{count}/peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        _say(json.dumps({name: value for name, value in metrics.items() if f"/{count}/" in name}))
    return metrics | (measure_cluster(folder, logs, scenes) if scenes else {})


def main() -> None:
    """Measure, print the table, write metrics.json and table.md."""
    arguments = asked(ScaleMeasurement)
    chosen = (8, (100,)) if arguments.quick else (arguments.scenes, arguments.simulated)
    folder = arguments.out or Path(tempfile.mkdtemp())
    metrics = measure(folder, arguments.logs, *chosen)
    rows = tuple(metrics.items())
    write_measured(arguments.out, metrics, as_markdown(Table("scale", "What many scenes cost", ("", "value"), rows)))


if __name__ == "__main__":
    main()

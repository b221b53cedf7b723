"""What many scenes cost: generated logs over a Ray cluster with storage and a killed node, and batches without work.

    python -m benchmarks.speed.scale [--out FOLDER] [--scenes N] [--simulated N ...]

Cluster: the pipeline `demo` with small pictures, one seed a scene, on three nodes of one processor each on this
machine; what scenes make goes to a storage behind fsspec (a folder), and nothing stays in the batch's own. One node is
killed while a scene runs on it. Every scene has to end well, with all of its artifacts whole in the storage.
Simulated: batches whose scenes end at once: what a scene costs beside its steps, as batches grow.
"""

from __future__ import annotations

import json
import resource
import shutil
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from pydantic import Field

from benchmarks.options import Measurement, asked
from benchmarks.results import write_measured
from benchmarks.speed.batch import measure_scheduler
from stages.engine.batch.expansion import read_batch
from stages.engine.batch.ray_executor import RayExecutor, load_ray
from stages.engine.batch.results import RESULTS_NAME, read_results
from stages.engine.batch.scene_run import PROCESS_NAME
from stages.engine.batch.session import run_batch
from stages.engine.batch.spec import RayOptions
from stages.engine.batch.storage import stored_digest
from stages.kit.measurement.tables import Table, as_markdown

NODES = 3
FIRST_SEED = 9000
PATIENCE = 3600.0
"""How long the killer waits for its moment [s]."""
SPEC = """
pipeline = "demo"
seeds = "{first}-{last}"
[set]
frames = 12
width = 160
height = 120
shapes = 2
[[scene]]
name = "room"
[storage]
url = "{url}"
keep = false
"""


class ScaleMeasurement(Measurement):
    """Options of the measurement."""

    scenes: int = Field(200, ge=0, description="Generated logs on the cluster")
    simulated: tuple[int, ...] = Field((100, 1000, 10_000), description="Sizes of batches without work")


def measure_cluster(folder: Path, scenes: int) -> dict[str, float]:
    """Run the scenes, kill a node, look at what is in the storage; return what a scene cost."""
    from ray.cluster_utils import Cluster

    url, out, spec = f"file://{folder}/storage", folder / "out", folder / "batch.toml"
    spec.write_text(SPEC.format(first=FIRST_SEED, last=FIRST_SEED + scenes - 1, url=url))
    batch = read_batch(spec)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    ended = threading.Event()
    try:
        for _ in range(NODES - 1):
            cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        killer = threading.Thread(target=_kill_a_node, args=(cluster, out, ended), daemon=True)
        killer.start()
        began = time.perf_counter()
        end = run_batch(batch, out, executor=RayExecutor(RayOptions(kind="ray", address=cluster.address)), say=_say)
        seconds = time.perf_counter() - began
    finally:
        ended.set()
        load_ray().shutdown()
        cluster.shutdown()
    if end.counts() != {"done": scenes}:
        raise RuntimeError(f"scenes failed: {end.counts()}; see {out}/summary.md")
    for result in end.ran:
        for step, digest in result.artifacts.items():
            if stored_digest(f"{url}/{result.job}", step, 60.0) != digest:
                raise RuntimeError(f"{result.job}: {step} is not whole in the storage")
    first = [result for result in end.ran if not result.lost]
    processor = [result.processor_seconds for result in first]
    return {
        "cluster/scenes": scenes,
        "cluster/lost": len(end.ran) - len(first),
        "cluster/wall_s": seconds,
        "cluster/processor_s": statistics.mean(processor),
        "cluster/processor_least_s": min(processor),
        "cluster/processor_most_s": max(processor),
        "cluster/megabytes": statistics.mean(result.artifact_bytes / 1e6 for result in first),
        "cluster/memory_mb": max(result.peak_memory_bytes / 1e6 for result in first),
    }


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _kill_a_node(cluster: Any, out: Path, ended: threading.Event) -> None:
    """Kill a node besides the head on which a scene runs, when the first results are there."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and not ended.wait(0.2):
        if not read_results(out / RESULTS_NAME):
            continue
        heads = [
            line.split()[-1]
            for record in out.glob(f"room/*/{PROCESS_NAME}")
            for line in (record.parent / "batch.log").read_text().splitlines()
            if line.startswith("# 2")
        ]
        for node in cluster.list_all_nodes():
            if node.node_id != cluster.head_node.node_id and any(h.endswith(node.node_id[:8]) for h in heads):
                cluster.remove_node(node, allow_graceful=False)
                return


def measure(scenes: int, simulated: tuple[int, ...]) -> dict[str, float]:
    """Return all figures."""
    metrics: dict[str, float] = {}
    for count in simulated:
        folder = Path(tempfile.mkdtemp())
        try:
            found = measure_scheduler(folder, count)
        finally:
            shutil.rmtree(folder)
        metrics |= {f"simulated/{count}/{name.split('/')[1]}": value for name, value in found.items()}
        metrics[f"simulated/{count}/peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        _say(json.dumps({name: value for name, value in metrics.items() if f"/{count}/" in name}))
    folder = Path(tempfile.mkdtemp())
    try:
        return metrics | (measure_cluster(folder, scenes) if scenes else {})
    finally:
        shutil.rmtree(folder)


def main() -> None:
    """Measure, print the table, write metrics.json and table.md."""
    arguments = asked(ScaleMeasurement)
    metrics = measure(*((2, (100,)) if arguments.quick else (arguments.scenes, arguments.simulated)))
    rows = tuple(metrics.items())
    write_measured(arguments.out, metrics, as_markdown(Table("scale", "What many scenes cost", ("", "value"), rows)))


if __name__ == "__main__":
    main()

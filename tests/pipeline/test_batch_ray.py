"""A Ray cluster of three nodes on this machine, one of which is killed while scenes run on it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from scenewright.stages.engine.batch.ray_executor import RayExecutor
from scenewright.stages.engine.batch.results import RESULTS_NAME, latest_by_job, read_results
from scenewright.stages.engine.batch.session import run_batch
from scenewright.stages.engine.batch.spec import RayOptions
from scenewright.stages.engine.batch.storage import stored_digest

from tests.unit.batch.batches import batch_of, program_command

ray = pytest.importorskip("ray", reason="the extra `cluster` is not installed")

pytestmark = pytest.mark.slow
SCENES = 9


@pytest.fixture
def cluster() -> Iterator[Any]:
    from ray.cluster_utils import Cluster

    started = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        for _ in range(2):
            started.add_node(num_cpus=1)
        started.wait_for_nodes()
        yield started
    finally:
        if ray.is_initialized():
            ray.shutdown()
        started.shutdown()


def hosts_of_running(out: Path) -> dict[str, str]:
    """Scene -> host/node of the attempt that runs now, from the logs' first lines."""
    found = {}
    for record in out.glob("*/.batch-process.json"):
        lines = (record.parent / "batch.log").read_text().splitlines()
        heads = [line for line in lines if line.startswith("# 2")]
        found[record.parent.name] = heads[-1].split()[-1]
    return found


def test_a_killed_node_costs_only_its_scenes(cluster: Any, tmp_path: Path) -> None:
    behaviours = {f"s{k}": "sleep 3" for k in range(SCENES)} | {"bad": "exit 3"}
    out, store = tmp_path / "out", tmp_path / "store"
    batch = batch_of(tmp_path, behaviours, f'[storage]\nurl = "file://{store}"\nkeep = false')
    head = cluster.head_node.node_id
    victim: dict[str, Any] = {}

    def kill_a_node() -> None:
        deadline = time.monotonic() + 90
        while time.monotonic() < deadline:
            running = hosts_of_running(out)
            if len(read_results(out / RESULTS_NAME)) < 3:
                running = {}  # in the middle, not at the beginning
            for node in cluster.list_all_nodes():
                hit = [scene for scene, host in running.items() if host.endswith("/" + node.node_id[:8])]
                if node.node_id != head and hit and len(running) >= 3:
                    victim.update(node=node.node_id[:8], scenes=hit)
                    cluster.remove_node(node, allow_graceful=False)
                    return
            time.sleep(0.1)

    killer = threading.Thread(target=kill_a_node)
    executor = RayExecutor(RayOptions(kind="ray", address=cluster.address, cpus=1, retries=2))
    killer.start()
    end = run_batch(batch, out, executor=executor, command=program_command)
    killer.join()
    assert victim, "no scene was running on a node that could be killed"
    assert end.counts() == {"done": SCENES, "bad input": 1} and end.exit_code == 3
    results = latest_by_job(read_results(out / RESULTS_NAME))
    lost = {name: result for name, result in results.items() if result.lost}
    assert set(lost) == set(victim["scenes"]), "only the scenes of the killed node ran again"
    for result in lost.values():
        assert result.attempts == 2 and not result.host.endswith(victim["node"]), "on another node"
    assert len({result.host for result in results.values()}) >= 2
    assert len(read_results(out / RESULTS_NAME)) == SCENES + 1
    for name, result in results.items():  # whole in the storage, and nowhere else
        for step, digest in result.artifacts.items():
            assert stored_digest(f"file://{store}/{name}", step, 60.0) == digest and not (out / name / step).exists()


def test_interrupting_stops_the_scenes_on_the_workers(cluster: Any, tmp_path: Path) -> None:
    batch, out = batch_of(tmp_path, {f"s{k}": "sleep 300" for k in range(3)}), tmp_path / "out"
    executor = RayExecutor(RayOptions(kind="ray", address=cluster.address))
    timer_passed = threading.Event()

    class Interrupting:
        """Raises KeyboardInterrupt once three scenes run, as Ctrl-C does in the main thread."""

        def __getattr__(self, name: str) -> Any:
            return getattr(executor, name)

        def completed(self, timeout: float) -> list:
            if len(hosts_of_running(out)) == 3:
                timer_passed.set()
                raise KeyboardInterrupt
            return executor.completed(timeout)

    interrupting: Any = Interrupting()
    with pytest.raises(KeyboardInterrupt):
        run_batch(batch, out, executor=interrupting, command=program_command)
    assert timer_passed.is_set() and hosts_of_running(out) == {} and read_results(out / RESULTS_NAME) == []
    assert (out / "summary.csv").read_text().count("not run") == 3

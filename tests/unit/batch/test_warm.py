"""Workers that keep libraries between scenes; that scenes end in them as they do without is in test_scene_run.py."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from scenewright.stages.engine.batch.local_executor import LocalExecutor
from scenewright.stages.engine.batch.session import run_batch
from scenewright.stages.engine.batch.warm import WORKER, WarmScenes

from tests.unit.batch.batches import batch_of, module_command
from tests.unit.batch.test_scene_run import scene


@pytest.fixture
def scenes() -> Iterator[WarmScenes]:
    found = WarmScenes()
    yield found
    found.close()


def workers() -> list[psutil.Process]:
    return [child for child in psutil.Process().children() if WORKER in child.cmdline()]


def text_of(folder: Path) -> str:
    return (folder / "run" / "sequence" / "data.txt").read_text()


def test_what_a_scene_loaded_is_there_for_the_next(scenes: WarmScenes, tmp_path: Path) -> None:
    for expected in ("False", "True", "True"):
        found = scenes(scene(tmp_path, "loaded"))
        assert found is not None and found.outcome == "done" and expected in text_of(tmp_path)
    assert len(workers()) == 1


def test_a_worker_that_is_killed_costs_no_scene(scenes: WarmScenes, tmp_path: Path) -> None:
    assert scenes(scene(tmp_path, "write"))
    (worker,) = workers()

    def kill() -> None:
        deadline = time.monotonic() + 20
        while not worker.children() and time.monotonic() < deadline:
            time.sleep(0.01)
        os.kill(worker.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    found = scenes(scene(tmp_path, "sleep 2"))
    killer.join()
    assert found is not None and found.outcome == "done" and text_of(tmp_path) == "sleep 1"
    assert workers() == [], "it ran without one"
    assert scenes(scene(tmp_path, "write")) and len(workers()) == 1


def test_other_limits_of_threads_need_another_worker(scenes: WarmScenes, tmp_path: Path) -> None:
    assert scenes(scene(tmp_path, "write"))
    (first,) = workers()
    assert scenes(scene(tmp_path, "write", environment={"SCENE_THREADS": "3"}))
    assert [process.pid for process in workers()] != [first.pid] and len(workers()) == 1


def test_a_batch_ends_with_its_workers(tmp_path: Path) -> None:
    batch = batch_of(tmp_path, {"a": "write", "b": "exit 3", "c": "write"})
    end = run_batch(batch, tmp_path / "out", executor=LocalExecutor(2, warm=True), command=module_command)
    assert end.counts() == {"done": 2, "bad input": 1} and workers() == []


def test_an_interrupted_scene_is_stopped_in_its_worker(scenes: WarmScenes, tmp_path: Path) -> None:
    class Interrupted(Exception):
        pass

    def interrupt() -> bool:
        raise Interrupted

    assert scenes(scene(tmp_path, "write"))
    with pytest.raises(Interrupted):
        scenes(scene(tmp_path, "sleep 60"), interrupt)
    (worker,) = workers()
    assert worker.children() == []

"""One scene in its process group: limits, signals, what is left behind, and what is said about it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.processes import created_at, descendants, resident_memory
from scenewright.stages.engine.batch.results import SceneResult
from scenewright.stages.engine.batch.scene_log import LOG_NAME
from scenewright.stages.engine.batch.scene_run import LAUNCHER, PROCESS_NAME, run_scene, this_host
from scenewright.stages.engine.batch.warm import WarmScenes

from tests.unit.batch.batches import PROGRAM_MODULE, job

Run = Callable[..., SceneResult | None]


def scene(folder: Path, behaviour: str, **changes: object) -> Job:
    log = folder / "log.txt"
    log.write_text(behaviour)
    command = (sys.executable, "-m", PROGRAM_MODULE, str(folder / "run"), str(log), "1")
    return job("a", folder=str(folder / "run"), command=command, grace=5.0, **changes)


@pytest.fixture(scope="module", params=["cold", "warm"])
def run(request: pytest.FixtureRequest) -> Iterator[Run]:
    """What runs scenes: a new process for each, or forks of a worker. What comes of a scene is the same."""
    if request.param == "cold":
        yield run_scene
        return
    scenes = WarmScenes()
    yield scenes
    scenes.close()


def alive(pid: int) -> bool:
    return created_at(pid) is not None


def test_a_scene_that_ends_well(run: Run, tmp_path: Path) -> None:
    found = run(scene(tmp_path, "write"))
    assert found is not None
    assert (found.outcome, found.exit_code, found.reason, found.failed_step) == ("done", 0, "", None)
    assert found.host == this_host() and found.seconds > 0 and found.peak_memory_bytes > 0
    assert (
        found.processor_seconds > 0
        and found.artifact_bytes == (tmp_path / "run" / "sequence" / "data.txt").stat().st_size
    )
    assert set(found.artifacts) == {"sequence"} and found.measures == {"sequence/frames": 7.0}
    assert not (tmp_path / "run" / PROCESS_NAME).exists()
    text = (tmp_path / "run" / LOG_NAME).read_text()
    assert text.startswith("# ") and PROGRAM_MODULE in text and "[1/1] sequence" in text


@pytest.mark.parametrize(
    ("behaviour", "outcome", "code", "reason"),
    [
        ("exit 3", "bad input", 3, "ingest: room 7: 3 of 120 frames"),
        ("outcome", "not ok", 4, "ingest: outcome is 'empty': nothing there (--accept empty goes on)"),
        ("exit 1", "crash", 1, "ingest: room 7: 3 of 120 frames"),
        ("signal 11", "crash", 139, "died of SIGSEGV"),
        ("signal 9", "crash", 137, "died of SIGKILL (the kernel does that when memory runs out)"),
    ],
)
def test_failures_are_told_apart(
    run: Run, tmp_path: Path, behaviour: str, outcome: str, code: int, reason: str
) -> None:
    found = run(scene(tmp_path, behaviour))
    assert found is not None
    assert (found.outcome, found.exit_code, found.reason, found.failed_step) == (outcome, code, reason, "sequence")
    assert found.outcomes == ({"sequence": "empty"} if outcome == "not ok" else {})


def test_a_disk_too_full_for_the_reason_is_the_reason(run: Run, tmp_path: Path) -> None:
    found = run(scene(tmp_path, "unsaid 6"))
    assert found is not None and found.outcome == "machine failure"
    assert found.reason.startswith("its log ends before the reason") and f"free at {tmp_path / 'run'}" in found.reason


def test_an_artifact_of_an_earlier_run_is_not_counted_for_a_failed_step(run: Run, tmp_path: Path) -> None:
    assert run(scene(tmp_path, "write"))
    found = run(scene(tmp_path, "exit 3"))
    assert found is not None and found.artifacts == {} and found.measures == {}
    assert (tmp_path / "run" / LOG_NAME).read_text().count("[1/1] sequence") == 2, "the log keeps both runs"


def test_noise_of_native_libraries_does_no_harm(run: Run, tmp_path: Path) -> None:
    found = run(scene(tmp_path, "noise"))
    assert found is not None and found.outcome == "crash"
    assert len(found.reason) <= 500 and found.reason.isprintable()
    assert b"standard output" in (tmp_path / "run" / LOG_NAME).read_bytes()


def test_a_program_that_does_not_exist(run: Run, tmp_path: Path) -> None:
    found = run(job("a", folder=str(tmp_path / "run"), command=("/nowhere/program",)))
    assert found is not None and found.outcome == "missing dependency" and "/nowhere/program" in found.reason


def test_a_folder_that_cannot_be_written(run: Run, tmp_path: Path) -> None:
    (tmp_path / "run").write_text("a file")
    found = run(scene(tmp_path, "write"))
    assert found is not None and (found.outcome, found.exit_code) == ("machine failure", 6)
    assert str(tmp_path / "run") in found.reason


def test_the_time_limit_stops_the_scene(run: Run, tmp_path: Path) -> None:
    begun = time.monotonic()
    # Long enough for the first step to begin on a busy machine.
    found = run(scene(tmp_path, "sleep 60", time_limit=3.0))
    assert found is not None and time.monotonic() - begun < 30
    assert (found.outcome, found.exit_code, found.reason) == ("time limit", 6, "ran longer than 3.0 s")
    assert found.failed_step == "sequence"
    assert "# stopped: time limit" in (tmp_path / "run" / LOG_NAME).read_text()


def test_what_does_not_heed_the_request_to_stop_is_killed(run: Run, tmp_path: Path) -> None:
    begun = time.monotonic()
    found = run(scene(tmp_path, "stubborn 60", time_limit=0.5).model_copy(update={"grace": 0.5}))
    assert found is not None and found.outcome == "time limit"
    assert 1.0 <= time.monotonic() - begun < 10


def test_the_memory_limit_stops_the_scene(run: Run, tmp_path: Path) -> None:
    found = run(scene(tmp_path, "allocate 300", memory_limit=150 * 2**20))
    assert found is not None
    assert (found.outcome, found.exit_code) == ("memory limit", 6)
    assert "the limit is 150 MiB" in found.reason and found.peak_memory_bytes > 150 * 2**20
    enough = run(scene(tmp_path, "write", memory_limit=150 * 2**20))
    assert enough is not None and enough.outcome == "done"


def test_the_address_space_is_limited_by_the_kernel(run: Run, tmp_path: Path) -> None:
    found = run(scene(tmp_path, "allocate 2000", address_space=500 * 2**20))
    assert found is not None and found.outcome == "crash" and "MemoryError" in found.reason


def test_nothing_outlives_its_scene(run: Run, tmp_path: Path) -> None:
    found = run(scene(tmp_path, "family 60"))
    assert found is not None and found.outcome == "done"
    child = int((tmp_path / "run" / "child.txt").read_text())
    deadline = time.monotonic() + 5
    while alive(child) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not alive(child)


def test_a_cancelled_scene_has_no_result(run: Run, tmp_path: Path) -> None:
    stop = threading.Event()
    threading.Timer(0.3, stop.set).start()
    assert run(scene(tmp_path, "sleep 60"), stop.is_set) is None


def test_a_scene_left_over_by_a_killed_batch_is_ended_first(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    leftover = subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", "import time; time.sleep(60)"], start_new_session=True
    )
    facts = {"group": leftover.pid, "created": created_at(leftover.pid), "host": this_host()}
    (folder / PROCESS_NAME).write_text(json.dumps(facts))
    threading.Thread(target=leftover.wait, daemon=True).start()
    found = run(scene(tmp_path, "write"))
    assert found is not None and found.outcome == "done" and not alive(leftover.pid)


def test_a_process_that_only_has_the_number_of_a_leftover_is_spared(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    other = subprocess.Popen([sys.executable, "-I", "-S", "-c", "import time; time.sleep(60)"], start_new_session=True)
    try:
        for facts in (
            {"group": other.pid, "created": 1.0, "host": this_host()},
            {"group": other.pid, "created": created_at(other.pid), "host": "elsewhere"},
            {"group": "x"},
        ):
            (folder / PROCESS_NAME).write_text(json.dumps(facts))
            assert run(scene(tmp_path, "write"))
            assert other.poll() is None
    finally:
        other.kill()
        other.wait()


def test_a_scene_dies_with_the_process_that_started_it(tmp_path: Path) -> None:
    mark, words = tmp_path / "pid.txt", [sys.executable, "-I", "-S"]
    child_code = f"import os, time; open({str(mark)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    code = (
        "import os, subprocess, time\n"
        f"subprocess.Popen([*{words!r}, {str(LAUNCHER)!r}, str(os.getpid()), *{words!r}, '-c', {child_code!r}])\n"
        "time.sleep(60)\n"
    )
    parent = subprocess.Popen([*words, "-c", code])
    deadline = time.monotonic() + 10
    while not (mark.exists() and mark.read_text()) and time.monotonic() < deadline:
        time.sleep(0.02)
    child = int(mark.read_text())
    parent.kill()
    parent.wait()
    while alive(child) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not alive(child)


def test_the_process_tree_is_seen_as_psutil_sees_it(tmp_path: Path) -> None:
    code = "import subprocess, sys, time; subprocess.Popen(['sleep', '30']); time.sleep(30)"
    parent = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    try:
        deadline = time.monotonic() + 10
        while not descendants(parent.pid) and time.monotonic() < deadline:
            time.sleep(0.02)
        expected = [child.pid for child in psutil.Process(parent.pid).children(recursive=True)]
        assert descendants(parent.pid) == expected and len(expected) == 1
        assert resident_memory(parent.pid) > psutil.Process(parent.pid).memory_info().rss
        assert descendants(2**22 + 5) == [] and resident_memory(2**22 + 5) == 0
    finally:
        os.killpg(parent.pid, 9)
        parent.wait()

"""Whole batches: limits, resuming after a kill at any moment, one at a time, job arrays run by hand."""

from __future__ import annotations

import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import psutil
import pytest
from scenewright.cli.batch_command import batch as batch_command
from scenewright.schemas.errors import MachineFailure, UsageError
from scenewright.stages.engine.batch.expansion import Batch, read_batch
from scenewright.stages.engine.batch.folder_lock import folder_lock
from scenewright.stages.engine.batch.local_executor import processors
from scenewright.stages.engine.batch.results import RESULTS_NAME, latest_by_job, read_results
from scenewright.stages.engine.batch.session import (
    BatchEnd,
    collect_tasks,
    plan_batch,
    run_batch,
    run_task,
    write_array,
)
from scenewright.stages.engine.reading import read_manifest

from tests.contract.test_command_line import REPOSITORY, scenewright
from tests.unit.batch.batches import batch_of, lines_of, program_command, write_batch

WAIT = 30.0
"""The longest wait for something that a test waits for [s]."""


def run(batch: Batch, out: Path, **options: object) -> BatchEnd:
    return run_batch(batch, out, command=program_command, **options)  # type: ignore[arg-type]


def outcomes(end: BatchEnd) -> dict[str, str]:
    return {name: result.outcome for name, result in sorted(end.latest.items())}


def runs_of(out: Path, job: str) -> int:
    """How often a scene was started."""
    path = out / job / "runs.txt"
    return len(path.read_text().splitlines()) if path.exists() else 0


def start(spec: Path, out: Path, jobs: int = 2) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tests.pipeline.batch_process", str(spec), str(out), str(jobs)]
    return subprocess.Popen(
        command,
        cwd=REPOSITORY,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        # A shell lets what it starts in the background ignore SIGINT, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def wait_for(condition: object, what: str) -> None:
    deadline = time.monotonic() + WAIT
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline, what
        time.sleep(0.01)


def test_every_kind_of_end_is_told_apart_and_stops_nobody_else(tmp_path: Path) -> None:
    behaviours = {
        "good": "write",
        "bad": "exit 3",
        "bad2": "exit 3",
        "empty": "outcome",
        "bug": "exit 1",
        "dead": "signal 11",
        "slow": "sleep 60",
        "large": "allocate 400",
    }
    limits = '[limits]\ntime = "10 s"\nmemory = "200 MiB"\ngrace = "2 s"'  # a busy machine allocates slowly
    end = run(batch_of(tmp_path, behaviours, limits), tmp_path / "out", jobs=2)
    assert outcomes(end) == {
        "good": "done",
        "bad": "bad input",
        "bad2": "bad input",
        "empty": "not ok",
        "bug": "crash",
        "dead": "crash",
        "slow": "time limit",
        "large": "memory limit",
    }
    assert end.exit_code == 1
    rows = list(csv.DictReader((tmp_path / "out" / "summary.csv").open()))
    assert Counter(row["kind"] for row in rows) == {"done": 1, "explained": 5, "crashed": 2}
    markdown = (tmp_path / "out" / "summary.md").read_text()
    assert "| explained | bad input | sequence | 2 | ingest: room 7: 3 of 120 frames | bad |" in markdown
    assert (tmp_path / "out" / "summary.html").read_text().endswith("</html>\n")
    assert {line["job"] for line in lines_of(tmp_path / "out" / RESULTS_NAME)} == set(behaviours)
    assert all((tmp_path / "out" / name / "batch.log").exists() for name in behaviours)


def test_running_again_does_only_what_is_missing_or_failed(tmp_path: Path) -> None:
    behaviours = {"a": "write", "b": "fail-once", "c": "exit 3", "d": "write"}
    batch, out = batch_of(tmp_path, behaviours), tmp_path / "out"
    assert run(batch, out).exit_code == 1
    first = latest_by_job(read_results(out / RESULTS_NAME))
    again = run(batch, out)
    assert outcomes(again) == {"a": "done", "b": "done", "c": "bad input", "d": "done"} and again.exit_code == 3
    assert [runs_of(out, name) for name in "abcd"] == [1, 2, 2, 1]
    assert again.latest["a"] == first["a"]
    assert [r.job for r in run(batch, out, retry="none").ran] == []
    assert len(run(batch, out, retry="all").ran) == 4 and runs_of(out, "a") == 2
    shutil.rmtree(out / "a" / "sequence")
    (tmp_path / "logs" / "d.txt").write_text("write more")
    reasons = {job.name: reason for job, reason in plan_batch(read_batch(batch.path), out, retry="none")}
    assert reasons["a"] and "sequence is gone" in reasons["a"] and reasons["d"] and "changed" in reasons["d"]
    assert reasons["b"] is None and reasons["c"] is None
    assert sorted(r.job for r in run(read_batch(batch.path), out, retry="none").ran) == ["a", "d"]


def test_more_scenes_later_leave_the_others_alone(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(batch_of(tmp_path, {"a": "write"}, head="seeds = [1]"), out)
    (tmp_path / "logs" / "b.txt").write_text("write")
    spec = tmp_path / "batch.toml"
    spec.write_text(spec.read_text().replace("seeds = [1]", "seeds = [1, 2]"))
    end = run(read_batch(spec), out)
    assert sorted(r.job for r in end.ran) == ["a/seed-2", "b/seed-1", "b/seed-2"] and end.counts() == {"done": 4}


def test_an_old_result_of_other_values_is_not_shown_as_one_of_these(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(batch_of(tmp_path, {"a": "write", "b": "write"}), out)
    for name in "ab":
        (tmp_path / "logs" / f"{name}.txt").write_text("exit 3")
    end = run(batch_of(tmp_path, {}, "[limits]\nstop_after_failures = 1"), out)
    assert sorted(end.counts().items()) == [("bad input", 1), ("not run", 1)] and end.exit_code == 3


def test_threads_are_shared_out_unless_the_user_has_set_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    batch, out = batch_of(tmp_path, {"a": "write"}), tmp_path / "out"
    run(batch, out, jobs=2)
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    run(batch, out, jobs=2, retry="all")
    own = batch_of(tmp_path, {}, '[executor]\nkind = "local"\nthreads = 3')
    monkeypatch.delenv("OMP_NUM_THREADS")
    run(own, out, retry="all")
    assert (out / "a" / "runs.txt").read_text().split() == [str(max(1, processors() // 2)), "7", "3"]


def test_two_batches_in_one_folder_are_refused(tmp_path: Path) -> None:
    batch, out = batch_of(tmp_path, {"a": "write"}), tmp_path / "out"
    with folder_lock(out), pytest.raises(MachineFailure, match="another batch is running"):
        run(batch, out)
    with folder_lock(out, shared=True), folder_lock(out, shared=True):  # tasks of an array
        with pytest.raises(MachineFailure):
            run(batch, out)
        with pytest.raises(MachineFailure):
            collect_tasks(batch, out)
    assert run(batch, out).exit_code == 0


def test_a_batch_killed_at_any_moment_is_resumed(tmp_path: Path) -> None:
    """SIGKILL of the batch itself, three times: no scene lives on, every line is whole, the end is a clean run's."""
    behaviours = {f"s{k}": "sleep 0.3" for k in range(6)} | {"x": "exit 3"}
    spec, out = write_batch(tmp_path, behaviours), tmp_path / "out"
    chance = random.Random(3)
    for _ in range(3):
        process = start(spec, out)
        wait_for(lambda: list(out.glob("*/.batch-process.json")), "no scene has started")
        time.sleep(chance.uniform(0.0, 0.6))
        groups = [json.loads(text)["group"] for path in out.glob("*/.batch-process.json") if (text := _read(path))]
        process.kill()
        process.communicate(timeout=WAIT)
        wait_for(lambda groups=groups: not any(map(_alive, groups)), "a scene lives on")
        read_results(out / RESULTS_NAME)
    done_before = {name for name, r in latest_by_job(read_results(out / RESULTS_NAME)).items() if r.outcome == "done"}
    with (out / RESULTS_NAME).open("ab") as file:
        file.write(b'{"job": "torn')
    process = start(spec, out)
    _, errors = process.communicate(timeout=WAIT)
    assert process.returncode == 3, errors
    assert "torn last line of 13 bytes" in errors
    results = read_results(out / RESULTS_NAME)
    assert {name: r.outcome for name, r in latest_by_job(results).items()} == {
        **{f"s{k}": "done" for k in range(6)},
        "x": "bad input",
    }
    counts = Counter(result.job for result in results)
    assert all(counts[name] == 1 for name in done_before), "what had ended well did not run again"
    assert not list(out.glob("*/.batch-process.json"))


def _read(path: Path) -> str:
    try:
        return path.read_text()
    except FileNotFoundError:
        return ""


def _alive(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_stops_the_scenes_and_writes_the_summary(tmp_path: Path, number: signal.Signals) -> None:
    spec, out = write_batch(tmp_path, {"a": "write", "b": "sleep 60", "c": "sleep 60"}), tmp_path / "out"
    process = start(spec, out, jobs=3)
    wait_for(lambda: "a" in latest_by_job(read_results(out / RESULTS_NAME)), "a has not ended")
    wait_for(lambda: runs_of(out, "b") and runs_of(out, "c"), "b and c have not started")
    process.send_signal(number)
    process.communicate(timeout=WAIT)
    assert process.returncode == 130
    rows = {row["scene"]: row["outcome"] for row in csv.DictReader((out / "summary.csv").open())}
    assert rows == {"a": "done", "b": "not run", "c": "not run"}
    for name in "bc":
        (tmp_path / "logs" / f"{name}.txt").write_text("write")
    end = run(read_batch(spec), out)
    assert sorted(r.job for r in end.ran) == ["b", "c"] and end.counts() == {"done": 3}


def test_a_job_array_run_by_hand_gives_what_the_batch_gives(tmp_path: Path) -> None:
    behaviours = {"a": "write", "b": "exit 3", "c": "write", "d": "sleep 0.1", "e": "write"}
    text = '[executor]\nkind = "slurm"\nscenes_per_task = 2\n[limits]\ntime = "20 s"'
    batch, out = batch_of(tmp_path, behaviours, text), tmp_path / "out"
    scripts = write_array(batch, out)
    assert scripts is not None and (scripts.tasks, scripts.scenes) == (3, 5)
    for index in range(scripts.tasks):
        task = run_task(batch, out, index, scripts.tasks, command=program_command)
        assert len(task.ran) == len(task.jobs) > 0
        assert run_task(batch, out, index, scripts.tasks, retry="none", command=program_command).ran == ()
    assert not (out / "summary.csv").exists() and read_results(out / RESULTS_NAME) == []
    end = collect_tasks(batch, out)
    assert outcomes(end) == {"a": "done", "b": "bad input", "c": "done", "d": "done", "e": "done"}
    assert end.exit_code == 3 and (out / "summary.html").exists() and not list((out / "slurm").glob("results-*"))
    assert write_array(batch, out, retry="none") is None
    left = write_array(batch, out)
    assert left is not None and left.scenes == 1, "only the one that failed is left"
    (tmp_path / "logs" / "a.txt").unlink()
    with pytest.raises(UsageError, match="write the scripts again"):
        (out / "slurm" / "jobs.txt").write_text("a\n")
        run_task(read_batch(batch.path), out, 0, 1, command=program_command)


@pytest.mark.parametrize(("options", "match"), [({"retry": "some"}, "--retry"), ({"task": "4"}, "INDEX/COUNT")])
def test_wrong_options_are_usage_errors(tmp_path: Path, options: dict[str, str], match: str) -> None:
    with pytest.raises(UsageError, match=match):
        batch_command(write_batch(tmp_path, {"a": "write"}), tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def write_log(folder: Path, frames: int) -> None:
    """A log in the layout of 7-Scenes: a slanted plane in front of a camera that moves sideways."""
    folder.mkdir(parents=True)
    columns, rows = np.meshgrid(np.arange(80), np.arange(60))
    np.savetxt(folder / "camera-intrinsics.txt", [[70.0, 0.0, 39.5], [0.0, 70.0, 29.5], [0.0, 0.0, 1.0]])
    for k in range(frames):
        pose = np.eye(4)
        pose[0, 3] = 0.02 * k
        np.savetxt(folder / f"frame-{k:06d}.pose.txt", pose)
        cv2.imwrite(str(folder / f"frame-{k:06d}.depth.png"), (1500 + 5 * rows).astype(np.uint16))
        color = np.stack([columns * 3, rows * 4, columns + rows + k], axis=-1).astype(np.uint8)
        cv2.imwrite(str(folder / f"frame-{k:06d}.color.jpg"), color)


def test_the_command_line_end_to_end(tmp_path: Path) -> None:
    """A good log and one of noise x two parameter sets through the real `scenewright run`; then an array's scripts."""
    write_log(tmp_path / "rooms" / "good", 4)
    (tmp_path / "rooms" / "noise").mkdir()
    (tmp_path / "rooms" / "noise" / "image.txt").write_text("no image")
    sets = '[[parameters]]\nname = "all"\nset = { every = 1 }\n[[parameters]]\nname = "half"\nset = { every = 2 }\n'
    spec = write_batch(tmp_path, {}, sets)
    spec.write_text(spec.read_text().replace('glob = "logs/*.txt"', 'glob = "rooms/*"'))
    out, names = tmp_path / "out", {f"{scene}/{given}" for scene in ("good", "noise") for given in ("all", "half")}
    dry = scenewright("batch", spec, "--out", out, "--dry-run", "--json")
    assert dry.returncode == 0 and dry.stderr == "" and not out.exists()
    assert set(json.loads(dry.stdout)["scenes"]) == names
    done = scenewright("batch", spec, "--out", out, "--jobs", "2", "--json")
    facts = json.loads(done.stdout)
    assert done.returncode == 3 and done.stderr == "", done.stderr
    assert facts["counts"] == {"done": 2, "bad input": 2} and set(facts["scenes"]) == names
    assert facts["scenes"]["good/all"]["measures"]["sequence/frames"] == 4.0
    assert facts["scenes"]["good/half"]["measures"]["sequence/frames"] == 2.0
    bad = facts["scenes"]["noise/all"]
    assert bad["failed_step"] == "sequence" and bad["reason"].startswith(f"{tmp_path}/rooms/noise"), bad
    digest = read_manifest(out / "good" / "all" / "sequence").content_digest
    assert facts["scenes"]["good/all"]["artifacts"] == {"sequence": digest}
    log = (out / "good" / "half" / "batch.log").read_text()
    assert "--set every=2" in log and "[1/1] sequence" in log and "Traceback" not in log
    spec.write_text(spec.read_text() + '[executor]\nkind = "slurm"\n')
    written = scenewright("batch", spec, "--out", out, "--json")
    assert written.returncode == 0 and json.loads(written.stdout)["submit"].endswith("submit.sh"), written.stderr
    task = subprocess.run(
        ["bash", str(out / "slurm" / "array.sh")],
        env={**os.environ, "SLURM_ARRAY_TASK_ID": "1"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert task.returncode == 3, task.stderr
    collected = subprocess.run(["bash", str(out / "slurm" / "collect.sh")], capture_output=True, text=True)
    assert collected.returncode == 3 and collected.stdout == f"{out}\n", collected.stderr
    assert len(read_results(out / RESULTS_NAME)) == 5 and "sequence/frames" in (out / "summary.md").read_text()
    nothing = scenewright("batch", spec, "--out", out, "--retry", "none", "--json")
    assert nothing.returncode == 3 and json.loads(nothing.stdout)["counts"] == facts["counts"], "as without Slurm"

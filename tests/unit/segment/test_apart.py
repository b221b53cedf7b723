"""Frames in processes of their own: the same bytes as one after another, and one line when a process dies."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from pathlib import Path

import pytest
from scenewright.schemas.errors import BadInput, MachineFailure
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.segment import apart
from scenewright.stages.segment.apart import LEAST_FRAMES_EACH, MOST_WORKERS, worker_count
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.stage import run

from tests.unit.export.sequences import write_sequence


@pytest.fixture(autouse=True)
def two_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if there were two processors and few frames were worth it."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)


def segmented(sequence: Path, output: Path, **options: object) -> str:
    output.mkdir()
    context = Context(output=output, seed=3, device="cpu", progress=SilentProgress())
    run(sequence, parameters=SegmentParameters(**options), context=context)
    return content_digest(record_files(output, ()))


def test_how_many(monkeypatch: pytest.MonkeyPatch) -> None:
    assert worker_count(10_000, True, "cpu") == 2
    assert worker_count(2 * LEAST_FRAMES_EACH - 1, True, "cpu") == 1
    assert worker_count(10_000, False, "cpu") == worker_count(10_000, True, "cuda") == 1
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)))
    assert worker_count(10_000, True, "cpu") == MOST_WORKERS
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert worker_count(10_000, True, "cpu") == 1


@pytest.mark.parametrize(
    "options",
    [
        {"backend": "geometric", "fusion": "thesis"},
        {"backend": "network"},
        {"backend": "ground-truth", "corruption": 0.4},
    ],
)
@pytest.mark.slow
def test_same_bytes(options: dict, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sequence = write_sequence(tmp_path / "sequence", 9, labels=True, without={4: ("depth",)})
    here = segmented(sequence, tmp_path / "here", **options)
    monkeypatch.setattr(apart, "LEAST_FRAMES_EACH", 2)
    used = []
    original = apart.segmented_apart
    monkeypatch.setattr(
        "scenewright.stages.segment.stage.segmented_apart", lambda *given: used.append(given[2]) or original(*given)
    )
    assert segmented(sequence, tmp_path / "apart", **options) == here and used == [2]
    assert multiprocessing.active_children() == []


def test_a_process_that_is_killed_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sequence = write_sequence(tmp_path / "sequence", 25)
    monkeypatch.setattr(apart, "LEAST_FRAMES_EACH", 2)

    def kill_one() -> None:
        while not (children := multiprocessing.active_children()):
            time.sleep(0.01)
        os.kill(children[0].pid or 0, signal.SIGKILL)

    killer = threading.Thread(target=kill_one)
    killer.start()
    with pytest.raises(MachineFailure, match="was killed") as caught:
        segmented(sequence, tmp_path / "out", backend="geometric", fusion="thesis")
    killer.join()
    assert "\n" not in str(caught.value) and multiprocessing.active_children() == []


def test_what_a_frame_raises_there_arrives_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame without labels, of a backend that needs them; with its hint."""
    sequence = write_sequence(tmp_path / "sequence", 9, labels=True)
    frames = sequence.path("frames.mcap")
    other = write_sequence(tmp_path / "other", 9)
    monkeypatch.setattr(apart, "LEAST_FRAMES_EACH", 2)
    frames.write_bytes(other.path("frames.mcap").read_bytes())
    with pytest.raises(BadInput, match="has no labels image") as caught:
        segmented(sequence, tmp_path / "out", backend="ground-truth")
    assert caught.value.hint

"""Frames come in the order of the log, however long each takes, with the reasons of those that cannot be used."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.ingest.loading import loaded
from scenewright.stages.ingest.source import Entry, FrameFiles, LoadedFrame, Unusable

DEPTH = np.ones((2, 2), np.uint16)


def entry_of(number: int, *, files: bool, load) -> Entry:
    paths = (
        FrameFiles(Path(f"{number}.jpg"), Path(f"{number}.png")) if files else FrameFiles(depth=Path(f"{number}.png"))
    )
    return Entry(str(number), float(number), None, load, files=paths)


@pytest.mark.parametrize("files", [True, False])
def test_in_order_with_reasons(files: bool) -> None:
    threads = set()

    def load(number: int):
        def loads() -> LoadedFrame:
            threads.add(threading.current_thread().name)
            time.sleep(0.002 * (number % 3))
            if number == 4:
                raise Unusable("no_valid_depth")
            return LoadedFrame(None, DEPTH * number)

        return loads

    entries = [entry_of(number, files=files, load=load(number)) for number in range(1, 9)]
    found = list(loaded(entries))
    assert [entry.name for entry, _ in found] == [entry.name for entry in entries]
    reasons = [images.reason for _, images in found if isinstance(images, Unusable)]
    assert reasons == ["no_valid_depth"]
    depths = [int(images.depth[0, 0]) for _, images in found if isinstance(images, LoadedFrame)]
    assert depths == [1, 2, 3, 5, 6, 7, 8]
    assert (threading.main_thread().name in threads) != files


def test_a_fault_of_ours_is_not_swallowed() -> None:
    def load() -> LoadedFrame:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        list(loaded([entry_of(1, files=True, load=load)]))

"""Frames of a log one after the other, the next ones loaded meanwhile where each has files of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor

from scenewright.stages.ingest.source import Entry, LoadedFrame, Unusable

THREADS = 2
"""Frames that are loaded at a time: decoding and resampling use one processor each."""

Result = Callable[[], LoadedFrame | Unusable]
"""Waits for a frame; Unusable is what loading it raised."""


def loaded(entries: Iterable[Entry]) -> Iterator[tuple[Entry, LoadedFrame | Unusable]]:
    """Yield the entries in order, each with its images or with why it cannot be used.

    A log in one file, or with a video, is read by this thread alone: its readers have one place in it. Frames whose
    colour and depth are files of their own are loaded up to `THREADS` ahead.
    """
    with ThreadPoolExecutor(THREADS, thread_name_prefix="load") as threads:
        waiting: deque[tuple[Entry, Result]] = deque()
        for entry in entries:
            if entry.files.color is None or entry.files.depth is None:
                yield entry, _load(entry)
                continue
            waiting.append((entry, threads.submit(_load, entry).result))
            if len(waiting) > THREADS:
                first, result = waiting.popleft()
                yield first, result()
        for entry, result in waiting:
            yield entry, result()


def _load(entry: Entry) -> LoadedFrame | Unusable:
    try:
        return entry.load()
    except Unusable as problem:
        return problem

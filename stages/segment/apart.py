"""Frames segmented one after another here, or in processes of their own: the same bytes either way."""

from __future__ import annotations

import ctypes
import logging
import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scenewright.schemas.errors import MachineFailure
from scenewright.schemas.segments import FrameSegments
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.masks import encode_panoptic_png
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.one_frame import describe, segment_frame
from scenewright.stages.segment.panoptic import Backend

LEAST_FRAMES_EACH = 60
"""Least frames of a process: with fewer it is not worth its start, which takes as long as some ten to twenty
frames."""
MOST_WORKERS = 8
"""Each holds a few hundred megabytes."""
AHEAD = 3
"""Frames a worker that may wait to be written."""
SET_PARENT_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of Linux."""

Segmented = tuple[int, np.ndarray | bytes, FrameSegments]
"""Index of a frame, ids (H, W) int32 or their PNG, record."""


def worker_count(frames: int, apart: bool, device: str) -> int:
    """Return in how many processes to segment; 1: in this one.

    No more than there are processors, than NUMBA_NUM_THREADS or OMP_NUM_THREADS give this step (a batch gives each
    scene its share), and than the frames are worth.
    """
    if not apart or device != "cpu" or not sys.platform.startswith("linux"):
        return 1
    allowed = [len(os.sched_getaffinity(0)), frames // LEAST_FRAMES_EACH, MOST_WORKERS]
    for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS"):
        threads = os.environ.get(name, "")
        if threads.isdigit():
            allowed.append(int(threads))
    return max(1, min(allowed))


def segmented_here(
    request: BackendRequest, backend: Backend, streams: tuple[str, ...], random: Callable[[int], np.random.Generator]
) -> Iterator[Segmented]:
    """Yield the segments of every frame of the log of a request, in order."""
    _, reader = request.log()
    for frame in reader.frames(streams=streams):
        fused = segment_frame(frame, reader, backend, request.parameters, random(frame.index))
        yield frame.index, fused.ids, describe(frame.index, fused)


def unsegmented(reader: FrameReader) -> Iterator[Segmented]:
    """Yield no segments for every frame of a log, in order: `fuse` makes nothing of segments that nobody named, it
    finds things in the surface of the whole room."""
    images = {
        name: encode_panoptic_png(np.zeros((camera.height, camera.width), np.int32))
        for name, camera in reader.cameras.items()
    }
    for frame in reader.frames(streams=()):
        yield frame.index, images[frame.camera_name], FrameSegments(frame=frame.index, segments=())


def segmented_apart(request: BackendRequest, streams: tuple[str, ...], workers: int) -> Iterator[Segmented]:
    """Yield the segments of every frame of the log of a request, in order, from `workers` processes.

    They are started anew, not forked: this process has threads. Each opens the log and the backend for itself. Raises
    MachineFailure when one of them dies, and what a frame raises there.
    """
    _, reader = request.log()
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), _open, (replace(request, reader=None), streams, os.getpid())
    )
    waiting: deque[Future[Segmented]] = deque()
    try:
        for index in range(len(reader)):
            waiting.append(_submitted(pool, index))
            if len(waiting) >= AHEAD * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BrokenProcessPool:
        # The pool ends those that it knew of when one died; one that was just being started it would wait for for ever.
        for worker in set(multiprocessing.active_children()) - others:
            worker.kill()
        raise MachineFailure(
            "a process that segments frames was killed, or did not start",
            hint="memory may be short: OMP_NUM_THREADS=1 needs one process",
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _submitted(pool: ProcessPoolExecutor, index: int) -> Future[Segmented]:
    """Hand a frame to a pool. Raises BrokenProcessPool also where a worker does not start: the machine has no room, or
    the one before it died meanwhile and closed the pipes that both share."""
    try:
        return pool.submit(_segment, index)
    except (OSError, ValueError) as error:
        raise BrokenProcessPool(str(error)) from error


class _Opened:
    """What a worker keeps between frames."""

    request: BackendRequest
    reader: FrameReader
    backend: Backend
    streams: tuple[str, ...]


def _open(request: BackendRequest, streams: tuple[str, ...], parent: int) -> None:
    """Open log and backend in a worker, which ends with its parent, uses one thread, and does not say again what its
    parent said when it opened them."""
    logging.getLogger("scenewright").setLevel(logging.ERROR)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears it and ends the workers
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)
    import cv2
    import numba

    numba.set_num_threads(1)
    cv2.setNumThreads(1)
    assert request.sequence is not None
    _Opened.reader = FrameReader(request.sequence.path("frames.mcap"))
    _Opened.request = replace(request, reader=_Opened.reader)
    _Opened.backend = choose_backend(_Opened.request)
    _Opened.streams = streams


def _segment(index: int) -> Segmented:
    opened = _Opened
    frame = opened.reader.read(index, opened.streams)
    random = np.random.default_rng([opened.request.seed, index])  # Context.random
    fused = segment_frame(frame, opened.reader, opened.backend, opened.request.parameters, random)
    return index, encode_panoptic_png(fused.ids), describe(index, fused)

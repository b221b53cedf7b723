"""Measuring time and memory: a clock, the peak of memory, and a process of its own to measure in."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

AS_THE_COMMAND_LINE = {"NUMBA_THREADING_LAYER": "omp", "OMP_WAIT_POLICY": "passive"}
"""Variables that cli/main.py sets: TBB is not probed, idle threads of OpenMP sleep."""


@dataclass
class Clock:
    """Seconds of each lap: by the wall, and of the processor (all threads; less moved by other work)."""

    wall: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)

    @contextmanager
    def lap(self) -> Iterator[None]:
        """Time what happens in here."""
        wall, processor = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            self.wall.append(time.perf_counter() - wall)
            self.processor.append(time.process_time() - processor)

    def wrap(self, owner: Any, name: str) -> None:
        """Replace `owner.name` by the same function, of which every call is a lap."""
        inner: Callable[..., Any] = getattr(owner, name)

        def timed(*arguments: Any, **named: Any) -> Any:
            with self.lap():
                return inner(*arguments, **named)

        setattr(owner, name, timed)

    def taken(self) -> float:
        """Return the processor seconds of all laps, and begin again."""
        seconds = sum(self.processor)
        self.wall.clear()
        self.processor.clear()
        return seconds


def medians(clock: Clock) -> tuple[float, float]:
    """Return the median of the laps [s]: by the wall, of the processor."""
    return float(np.median(clock.wall)), float(np.median(clock.processor))


def memory(entry: str) -> float:
    """Return `VmRSS` (resident now) or `VmHWM` (the most since the peak was reset) of this process [MB]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(entry + ":"):
            return int(line.split()[1]) / 1024
    raise RuntimeError(f"/proc/self/status has no {entry}")


def reset_peak() -> None:
    """Make VmHWM start again from what is resident now."""
    Path("/proc/self/clear_refs").write_text("5")


def alone(function: Callable[..., Any], *arguments: Any, **variables: str) -> Any:
    """Return what a function of a module returns in a fresh process, which has these environment variables."""
    before = dict(os.environ)
    os.environ.update(variables)
    try:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            return pool.submit(function, *arguments).result()
    finally:
        os.environ.clear()
        os.environ.update(before)

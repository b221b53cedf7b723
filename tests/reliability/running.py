"""What the fault tests share: the probe step in a process of its own, under limits or on a disk of a few megabytes."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


def run_probe(
    *words: str | Path, limits: Callable[[], None] | None = None, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run `scenewright probe WORDS...` in a new process; `limits` is called in it before it starts."""
    return subprocess.run(
        [sys.executable, "-m", "tests.reliability.probe_command", "probe", *map(str, words)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        preexec_fn=limits,
        env={**os.environ, **(environment or {})},
        timeout=60,
    )


def file_size_limit(limit: int) -> Callable[[], None]:
    """Return a function that limits the size of every file written by this process [bytes]."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


def memory_limit(limit: int) -> Callable[[], None]:
    """Return a function that limits the address space of this process [bytes]."""
    return lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def only_error(done: subprocess.CompletedProcess[str]) -> str:
    """Return the one line of error that a failed command printed."""
    lines = [line for line in done.stderr.splitlines() if line.startswith("error:")]
    assert len(lines) == 1 and "Traceback" not in done.stderr, done.stderr
    return lines[0]


@contextmanager
def small_disk(folder: Path, options: str) -> Iterator[Path]:
    """Mount a file system in memory (`size=2m`) at `folder`; skips the test where that is not allowed."""
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], capture_output=True)
    if mounted.returncode != 0:
        pytest.skip("mounting is not allowed here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)

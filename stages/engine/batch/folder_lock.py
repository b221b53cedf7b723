"""One batch at a time in a folder; the tasks of a job array share it among themselves."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from scenewright.schemas.errors import MachineFailure

LOCK_NAME = ".batch.lock"


@contextlib.contextmanager
def folder_lock(folder: Path, *, shared: bool = False, name: str = LOCK_NAME) -> Iterator[None]:
    """Hold the lock of a batch folder, which is made if need be. Raises MachineFailure when another batch holds it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / name, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise MachineFailure(f"{folder}: {error.strerror}", hint="choose another --out") from None
    try:
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            raise MachineFailure(
                f"{folder}: another batch is running in it", hint="wait for it to end, or choose another --out"
            ) from None
        yield
    finally:
        os.close(descriptor)

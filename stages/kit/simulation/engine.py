"""Import pybullet quietly: the library prints its build time and warnings to standard output, where data goes."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def native_output_to_stderr() -> Iterator[None]:
    """Send what C code prints to standard output to standard error instead."""
    library = ctypes.CDLL(None)
    sys.stdout.flush()
    library.fflush(None)
    saved = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        library.fflush(None)
        os.dup2(saved, 1)
        os.close(saved)


with native_output_to_stderr():
    import pybullet as engine

__all__ = ["engine", "native_output_to_stderr"]

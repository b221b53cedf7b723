"""Import pybullet quietly: the library prints its build time and warnings to standard output, where data goes."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def native_output_to_stderr() -> Iterator[None]:
    """Send what C code prints to standard output to standard error instead, afterwards and in whole lines."""
    library = ctypes.CDLL(None)
    sys.stdout.flush()
    library.fflush(None)
    saved = os.dup(1)
    with tempfile.TemporaryFile() as printed:
        try:
            os.dup2(printed.fileno(), 1)
            yield
        finally:
            library.fflush(None)
            os.dup2(saved, 1)
            os.close(saved)
            printed.seek(0)
            with contextlib.suppress(OSError):  # nobody may be there to be told
                for line in printed:
                    os.write(2, line if line.endswith(b"\n") else line + b"\n")


with native_output_to_stderr():
    import pybullet as engine

__all__ = ["engine", "native_output_to_stderr"]

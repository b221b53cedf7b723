"""Reading arrays of NPZ payloads."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np

from schemas.errors import BadInput


def read_arrays(path: Path, *names: str) -> tuple[np.ndarray, ...]:
    """Return the named arrays of an NPZ file. Raises BadInput when it is missing, broken or lacks one."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            return tuple(archive[name] for name in names)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise BadInput(f"{path}: {error}", hint="make the artifact again") from None

"""Where things lie: in a checkout beside the folders of the code, in an installation below `scenewright/`."""

from __future__ import annotations

import errno
import os
from functools import cache
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
"""What holds `stages/`, `schemas/`, `cli/` and `data/`: a checkout, or the installed package."""
DATA = HOME / "data"
REINSTALL = "install scenewright again"
"""What to do about a file of `data/` that is missing or damaged."""


def data_file(name: str) -> Path:
    """Return the path of a file or folder of `data/`, there or not: `data_file("robots/panda.toml")`."""
    return DATA / name


@cache
def checkout() -> Path | None:
    """Return the folder of the checkout that this code is run from; None where it was installed."""
    return HOME if (HOME / "scenewright" / "__init__.py").is_file() else None


def resolved(path: Path) -> Path:
    """Return the path without links. Raises OSError or RuntimeError for a loop of links, whatever the Python."""
    place = path.resolve()
    if place.is_symlink():  # from 3.13 on `resolve` stops at a loop and says nothing
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    return place


def import_folder() -> Path:
    """Return the folder that has to be on `sys.path` for `import scenewright` to find this very code."""
    return checkout() or HOME.parent

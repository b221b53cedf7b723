"""Where things lie: in a checkout beside the folders of the code, in an installation below `scenewright/`."""

from __future__ import annotations

from functools import cache
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
"""What holds `stages/`, `schemas/`, `cli/` and `data/`: a checkout, or the installed package."""
DATA = HOME / "data"


def data_file(name: str) -> Path:
    """Return the path of a file or folder of `data/`, there or not: `data_file("robots/panda.toml")`."""
    return DATA / name


@cache
def checkout() -> Path | None:
    """Return the folder of the checkout that this code is run from; None where it was installed."""
    return HOME if (HOME / "scenewright" / "__init__.py").is_file() else None


def import_folder() -> Path:
    """Return the folder that has to be on `sys.path` for `import scenewright` to find this very code."""
    return checkout() or HOME.parent

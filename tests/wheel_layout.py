"""The packages as the wheel has them, for tools that read the tree instead of importing it.

`python -m tests.wheel_layout FOLDER` links them below a folder: type checkers do not follow `scenewright.__path__`.
"""

from __future__ import annotations

import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGES = ("cli", "schemas", "stages")


def link_packages(folder: Path) -> None:
    """Make `folder/scenewright` with links to its files and packages, and `folder/benchmarks`."""
    package = folder / "scenewright"
    package.mkdir(parents=True, exist_ok=True)
    sources = [*(REPOSITORY / "scenewright").glob("*.*"), *(REPOSITORY / name for name in PACKAGES)]
    for link, source in [(package / source.name, source) for source in sources] + [
        (folder / "benchmarks", REPOSITORY / "benchmarks")
    ]:
        link.unlink(missing_ok=True)
        link.symlink_to(source)


if __name__ == "__main__":
    link_packages(Path(sys.argv[1]))

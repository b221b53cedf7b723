"""Which folders the packages are (`scenewright.stages` is `stages/`, and so on) and which files go with the code."""

from pathlib import Path

from setuptools import find_packages, setup

FOLDERS = {
    "scenewright": "scenewright",
    "scenewright.cli": "cli",
    "scenewright.data": "data",
    "scenewright.schemas": "schemas",
    "scenewright.stages": "stages",
}
NOT_SHIPPED = {".py", ".pyc", ".nbc", ".nbi", ".mk", ".sh"}
"""Code, which goes by packages, what Python and numba make of it, and what only a checkout uses."""


def files_of(folder: str) -> list[str]:
    """Return the files below a folder that are no code: pages, templates, schemas, tables, networks."""
    found = [path for path in Path(folder).rglob("*") if path.is_file() and path.suffix not in NOT_SHIPPED]
    return sorted(path.relative_to(folder).as_posix() for path in found)


setup(
    package_dir=FOLDERS,
    packages=[
        *FOLDERS,
        *(f"{package}.{below}" for package, folder in FOLDERS.items() for below in find_packages(folder)),
    ],
    package_data={package: files_of(folder) for package, folder in FOLDERS.items()},
)

"""Which folders the packages are: `scenewright.stages` is `stages/`, and so on."""

from setuptools import find_packages, setup

FOLDERS = {
    "scenewright": "scenewright",
    "scenewright.cli": "cli",
    "scenewright.schemas": "schemas",
    "scenewright.stages": "stages",
}

setup(
    package_dir=FOLDERS,
    packages=[
        *FOLDERS,
        *(f"{package}.{below}" for package, folder in FOLDERS.items() for below in find_packages(folder)),
    ],
)

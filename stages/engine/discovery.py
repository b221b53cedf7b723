"""Finding the steps: every folder stages/<name>/ with a parameters.py is one, and nothing else has to be told.

So is every package that an installed distribution names in the entry points of `STEPS`. The trainings of ours are found
alike: every folder stages/<name>/training/<training>/.
"""

from __future__ import annotations

import importlib
from functools import cache
from pathlib import Path

from scenewright.schemas.errors import UsageError
from scenewright.schemas.plugins import installed, taken
from scenewright.stages.kit.declared import declared_in
from scenewright.stages.kit.stage import Stage
from scenewright.stages.kit.training.declaration import TrainingDeclaration

STAGES_FOLDER = Path(__file__).resolve().parents[1]
OURS = "scenewright.stages"
STEPS = "scenewright.steps"
"""Group of entry points; each names a package that is built as a folder of stages/ is."""


def _declared(package: str) -> list[Stage]:
    """Return the steps of a package. Raises RuntimeError where it declares none."""
    module = importlib.import_module(f"{package}.parameters")
    stages = getattr(module, "STAGES", None) or [getattr(module, "STAGE", None)]
    if not all(isinstance(stage, Stage) for stage in stages):
        raise RuntimeError(f"{module.__name__} declares no STAGE")
    return list(stages)


@cache
def _found() -> tuple[dict[str, Stage], dict[str, str]]:
    """Return the steps by name, and the package of each."""
    stages: dict[str, Stage] = {}
    packages: dict[str, str] = {}

    def take(package: str, folder: str | None) -> None:
        declared = _declared(package)
        for stage in declared:
            if folder not in (None, stage.folder) or stage.name in stages:
                raise RuntimeError(f"step {stage.name!r} is declared twice or in the wrong folder: {package}")
        stages.update({stage.name: stage for stage in declared})
        packages.update({stage.name: package for stage in declared})

    for parameters_file in sorted(STAGES_FOLDER.glob("*/parameters.py")):
        folder = parameters_file.parent.name
        take(f"{OURS}.{folder}", folder)
    if installed(STEPS):
        importlib.import_module("scenewright.schemas.kinds")  # ours come first: a kind's name can be taken once
    taken(STEPS, lambda module: take(module.__name__, None))
    return stages, packages


def all_stages() -> dict[str, Stage]:
    """Return every declared step by its command name. Imports declarations only, no step's code."""
    return _found()[0]


def package_of(stage: Stage) -> str:
    """Return the package with the code of a step: `scenewright.stages.fuse`, or one that was installed."""
    return _found()[1].get(stage.name, f"{OURS}.{stage.folder}")


def stage_by_name(name: str) -> Stage:
    """Return one step. Raises UsageError for an unknown name."""
    stages = all_stages()
    if name not in stages:
        raise UsageError(f"no step {name!r}", hint=f"steps are: {', '.join(stages)}")
    return stages[name]


@cache
def all_trainings() -> dict[str, TrainingDeclaration]:
    """Return every declared training by its name, step by step. Imports declarations only."""
    found: dict[str, TrainingDeclaration] = {}
    for folder in sorted({stage.folder for stage in all_stages().values()}):
        package = f"scenewright.stages.{folder}.training"
        if not (STAGES_FOLDER / folder / "training").is_dir():
            continue
        for training in declared_in(package, TrainingDeclaration, "TRAINING"):
            if training.name in found:
                raise RuntimeError(f"training {training.name!r} is declared twice: {package}")
            found[training.name] = training
    return found

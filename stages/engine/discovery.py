"""Finding the steps: every folder stages/<name>/ with a parameters.py is one, and nothing else has to be told.

So are their trainings: every folder stages/<name>/training/<training>/.
"""

from __future__ import annotations

import importlib
from functools import cache
from pathlib import Path

from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.declared import declared_in
from scenewright.stages.kit.stage import Stage
from scenewright.stages.kit.training.declaration import TrainingDeclaration

STAGES_FOLDER = Path(__file__).resolve().parents[1]


@cache
def all_stages() -> dict[str, Stage]:
    """Return every declared step by its command name. Imports declarations only, no step's code."""
    found: dict[str, Stage] = {}
    for parameters_file in sorted(STAGES_FOLDER.glob("*/parameters.py")):
        module = importlib.import_module(f"scenewright.stages.{parameters_file.parent.name}.parameters")
        for stage in getattr(module, "STAGES", None) or [module.STAGE]:
            if stage.folder != parameters_file.parent.name or stage.name in found:
                raise RuntimeError(f"step {stage.name!r} is declared twice or in the wrong folder: {parameters_file}")
            found[stage.name] = stage
    return found


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

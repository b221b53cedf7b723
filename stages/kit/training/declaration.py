"""How a training declares itself: its name, its options, and where its code is. Cheap to import."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.stage import Parameters


class TrainingParameters(Parameters):
    """Options of every training."""

    quick: bool = Field(False, description="Proves the recipe: little data, few steps")


@dataclass(frozen=True)
class TrainingDeclaration:
    """A training, as the `__init__.py` of its folder `stages/<step>/training/<folder>/` declares it under TRAINING.

    `train.py` of that folder holds `train(options, out)`, which writes into the folder `out`; it is loaded when it is
    used. Nothing that a step's `run` reaches imports a training.
    """

    name: str
    """What `scenewright train` calls it."""
    summary: str
    """What is learned and from what, one line."""
    package: str
    """`__name__` of the folder."""
    parameters: type[TrainingParameters]
    order: int = 0

    def run(self, options: TrainingParameters, out: Path) -> None:
        """Train into `out`, which is made. Raises ScenewrightError for what the options name and is not there."""
        out.mkdir(parents=True, exist_ok=True)
        importlib.import_module(f"{self.package}.train").train(options, out)

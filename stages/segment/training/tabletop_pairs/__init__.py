"""The trees by which `segment --backend objects` tells which patches are one object."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class PairsTraining(TrainingParameters):
    """Options."""

    data: Path = Field(description="Folder that holds mosd_tabletop (docs/DATA.md)")
    ship: bool = Field(False, description="Copy the trees to data/networks")


TRAINING = TrainingDeclaration(
    name="tabletop-pairs",
    summary="the trees of `segment --backend objects`, on generated tabletops and real ones",
    package=__name__,
    parameters=PairsTraining,
    order=2,
)

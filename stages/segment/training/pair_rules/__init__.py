"""The rules by which `segment --backend objects` tells which patches are one object."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class RulesTraining(TrainingParameters):
    """Options."""

    data: Path = Field(description="Folder that holds mosd_tabletop (docs/DATA.md)")


TRAINING = TrainingDeclaration(
    name="pair-rules",
    summary="the rules of `segment --backend objects --grouping rules`, on the same frames",
    package=__name__,
    parameters=RulesTraining,
    order=3,
)

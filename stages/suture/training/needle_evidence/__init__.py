"""The weights by which outlines of a needle are held against each other."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class EvidenceTraining(TrainingParameters):
    """Options."""

    rivals: Path | None = Field(
        None,
        description="Rivals of the views, a line of JSON a view; what is there is not made again [OUT/rivals.jsonl]",
    )


TRAINING = TrainingDeclaration(
    name="needle-evidence",
    summary="the weights by which `suture needle` holds outlines against each other, on rendered tuning views",
    package=__name__,
    parameters=EvidenceTraining,
    order=1,
)

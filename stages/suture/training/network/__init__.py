"""The network that finds needle and thread, trained on rendered views (docs/STITCH.md)."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class NetworkTraining(TrainingParameters):
    """Options."""

    views: Path | None = Field(None, description="Where rendered views are kept; OUT/views if not given")
    start: Path | None = Field(None, description="Refine this checkpoint")
    cluttered: bool = Field(
        False, description="Refine it with blood and highlights, needles before jaws, more endoscopes"
    )
    trials: bool = Field(False, description="Learn views of whole suture trials too")
    steps: int = Field(2000, ge=1, description="Steps")
    batch: int = Field(8, ge=1, description="Crops a step")
    seed: int = Field(0, ge=0, description="Seed")
    save_every: float = Field(240.0, gt=0, description="Seconds between states")


TRAINING = TrainingDeclaration(
    name="suture-network",
    summary="the network that finds needle and thread, on views of the needle world that are rendered first",
    package=__name__,
    parameters=NetworkTraining,
)

"""The probabilities of answers to words, fitted on places that were asked (docs/SPLATS.md)."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class ProbabilitiesTraining(TrainingParameters):
    """Options; a fit takes no time, so that `quick` changes nothing."""

    places: Path = Field(description="Folder of asked places with their answers (asked_places.py)")
    write: bool = Field(False, description="Write data/words/calibration.toml")


TRAINING = TrainingDeclaration(
    name="word-probabilities",
    summary="how likely an answer to words is right, on asked places whose answers are known",
    package=__name__,
    parameters=ProbabilitiesTraining,
    order=1,
)

"""The constants by which the network's output is grouped."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class ThresholdsTraining(TrainingParameters):
    """Options."""

    frames: Path = Field(description="Folder of frames that the network was trained on; its `validation` is read")
    weights: Path = Field(description="Of the network")
    every: int = Field(2, ge=1, description="Every so many frames; every 40th with --quick")


TRAINING = TrainingDeclaration(
    name="network-thresholds",
    summary="the constants by which `segment --backend network` groups, on validation frames",
    package=__name__,
    parameters=ThresholdsTraining,
    order=1,
)

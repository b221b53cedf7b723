"""The network of `segment --backend network`, trained on stored frames (docs/SEGMENTATION.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class NetworkTraining(TrainingParameters):
    """Options."""

    frames: Path = Field(description="Folder with the shards of `training` and `validation` (shards.py)")
    real: Path | None = Field(None, description="Folder with shards of real frames, a few in every batch")
    steps: int = Field(2500, ge=1, description="Steps")
    batch: int = Field(32, ge=1, description="Frames a step")
    seed: int = Field(0, ge=0, description="Seed")
    device: Literal["cpu", "cuda"] = Field("cpu", description="Where it is trained")
    threads: int = Field(1, ge=1, description="Of the processor; 1 gives the same bytes again")
    seconds: float | None = Field(None, gt=0, description="Ends after so many, however many steps were taken")
    save_every: float = Field(240.0, gt=0, description="Seconds between states")


TRAINING = TrainingDeclaration(
    name="network",
    summary="the network of `segment --backend network`, on stored frames of generated rooms and tabletops",
    package=__name__,
    parameters=NetworkTraining,
)

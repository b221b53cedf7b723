"""The embedded encoder of pictures and words, trained on samples of generated rooms (docs/SPLATS.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class WordsTraining(TrainingParameters):
    """Options."""

    samples: Path = Field(description="Folder with training.npz and validation.npz (samples.py)")
    steps: int = Field(10_000, ge=1, description="Steps")
    batch: int = Field(1024, ge=1, description="Crops a step")
    seed: int = Field(0, ge=0, description="Seed")
    device: Literal["cpu", "cuda"] = Field("cpu", description="Where it is trained")
    save_every: float = Field(120.0, gt=0, description="Seconds between states")


TRAINING = TrainingDeclaration(
    name="words",
    summary="the embedded encoder of images and words, on samples of generated rooms and models",
    package=__name__,
    parameters=WordsTraining,
)

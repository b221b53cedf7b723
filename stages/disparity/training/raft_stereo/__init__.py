"""The small RAFT-Stereo, trained on rendered pairs and random shapes (docs/MAPPING.md)."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class StereoTraining(TrainingParameters):
    """Options."""

    pairs: Path = Field(description="Folder of kept pairs (kept_pairs.py), of rooms and of needles")
    steps: int = Field(1750, ge=1, description="Steps")
    seed: int = Field(0, ge=0, description="Seed")
    save_every: float = Field(120.0, gt=0, description="Seconds between states")


TRAINING = TrainingDeclaration(
    name="raft-stereo",
    summary="the small network of `disparity --method raft-stereo`, on rendered pairs and random shapes",
    package=__name__,
    parameters=StereoTraining,
)

"""Scenewright from Python: `from scenewright import load, load_run` (docs/PYTHON.md)."""

from schemas.errors import BadInput, ScenewrightError
from stages.engine.loading import LoadedArtifact, load, load_run

__all__ = ["BadInput", "LoadedArtifact", "ScenewrightError", "load", "load_run"]

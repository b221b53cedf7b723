"""Scenewright from Python: `from scenewright import load, load_run, payload` (docs/PYTHON.md)."""

from schemas.artifact import Artifact
from schemas.errors import BadInput, ScenewrightError
from stages.engine.loading import as_networkx, load, load_run, payload
from stages.engine.tables import as_tables

__all__ = ["Artifact", "BadInput", "ScenewrightError", "as_networkx", "as_tables", "load", "load_run", "payload"]

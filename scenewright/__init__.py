"""Scenewright from Python: `from scenewright import load, load_run, payload` (docs/PYTHON.md).

`scenewright.stages`, `scenewright.schemas` and `scenewright.cli` lie in this package where it was installed as a wheel,
and beside its folder in a checkout.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if not Path(__path__[0], "stages").is_dir():
    __path__.append(str(Path(__path__[0]).parent))

if TYPE_CHECKING:
    from scenewright.schemas.artifact import Artifact
    from scenewright.schemas.errors import BadInput, ScenewrightError
    from scenewright.stages.engine.loading import as_networkx, load, load_run, payload
    from scenewright.stages.engine.tables import as_tables

_MODULES = {
    "Artifact": "schemas.artifact",
    "BadInput": "schemas.errors",
    "ScenewrightError": "schemas.errors",
    "as_networkx": "stages.engine.loading",
    "as_tables": "stages.engine.tables",
    "load": "stages.engine.loading",
    "load_run": "stages.engine.loading",
    "payload": "stages.engine.loading",
}

__all__ = ["Artifact", "BadInput", "ScenewrightError", "as_networkx", "as_tables", "load", "load_run", "payload"]


def __getattr__(name: str) -> Any:
    """Load what is asked for: every module of ours passes through here, and most need none of these."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)

"""Scenewright from Python: `from scenewright import load, load_run, payload` (docs/EDIT.md).

`scenewright.stages`, `scenewright.schemas` and `scenewright.cli` lie in this package where it was installed as a wheel,
and beside its folder in a checkout.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if not Path(__path__[0], "stages").is_dir():
    __path__.append(str(Path(__path__[0]).parent))

from scenewright.stages.kit.exports import exported  # noqa: E402

if TYPE_CHECKING:
    from scenewright.schemas.artifact import Artifact
    from scenewright.schemas.errors import BadInput, ScenewrightError
    from scenewright.stages.engine.loading import as_networkx, load, load_run, payload
    from scenewright.stages.engine.tables import as_tables


__all__ = ["Artifact", "BadInput", "ScenewrightError", "as_networkx", "as_tables", "load", "load_run", "payload"]

__getattr__ = exported(__name__)

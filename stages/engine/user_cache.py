"""The folder of the user in which scenewright keeps what it can make again."""

from __future__ import annotations

import os
from pathlib import Path

from scenewright.stages.engine.hub_cache import home_folder


def cache_folder(name: str) -> Path:
    """Return `$XDG_CACHE_HOME/scenewright/<name>`, else `~/.cache/scenewright/<name>`; it need not exist.

    Raises MachineFailure where no home folder is known.
    """
    return Path(os.environ.get("XDG_CACHE_HOME") or home_folder() / ".cache") / "scenewright" / name

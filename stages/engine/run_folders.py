"""Run folders: which artifacts stand in them."""

from __future__ import annotations

import os
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.store import complete_interrupted


def is_artifact(folder: Path) -> bool:
    """Whether a folder holds a manifest; an interrupted replacement of it is completed first."""
    complete_interrupted(folder)
    return os.path.isfile(folder / MANIFEST_NAME)


def artifacts_of(run: Path) -> dict[str, Path]:
    """Return name -> folder of the artifacts directly in a run folder, by name. Raises BadInput when there are none."""
    if not os.path.isdir(run):
        raise BadInput(f"{run}: no such run folder", hint="give the --out of `scenewright run`")
    folders = {
        entry.name: entry
        for entry in sorted(run.iterdir())
        if entry.is_dir() and not entry.is_symlink() and not entry.name.startswith(".") and is_artifact(entry)
    }
    if not folders:
        raise BadInput(f"{run}: holds no artifacts", hint="give the --out of `scenewright run`")
    return folders

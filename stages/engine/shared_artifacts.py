"""Artifacts that many runs need alike, made once: `--shared FOLDER` (the CAD library of the pipelines).

`FOLDER` holds whole artifacts by step and key, so that what is taken is what the step would make, and is kept only
for steps without inputs. It lies beside the run folders; deleting it costs nothing but time. What is taken is linked
(copied, where it lies on another file system) and its bytes are checked: nobody writes into a file of an artifact, so
that a run folder stays whole by itself.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from scenewright.schemas.errors import MachineFailure, ScenewrightError
from scenewright.schemas.manifest import Manifest
from scenewright.stages.engine import store
from scenewright.stages.engine.reading import check_hashes, check_sizes, read_manifest
from scenewright.stages.kit.stage import Stage

KEY_LENGTH = 16
"""Hexadecimal digits of a key in the name of a shared artifact."""
KEPT = 4
"""Entries of a step in a shared folder; the oldest go."""


def shared_entry(folder: Path, stage: Stage, key: str) -> Path:
    """Return where the artifact of this key is kept, whether it is there or not."""
    return folder / f"{_prefix(stage)}{key[:KEY_LENGTH]}"


def take(folder: Path, stage: Stage, key: str, partial: Path) -> Manifest | None:
    """Copy the kept artifact of this key into the empty folder `partial`; None when there is none, or not whole."""
    entry = shared_entry(folder, stage, key)
    try:
        manifest = read_manifest(entry)
        if manifest.key != key or manifest.kind != stage.writes.kind:
            return None
        check_sizes(entry, manifest)
        shutil.copytree(entry, partial, dirs_exist_ok=True, copy_function=_link)
        check_hashes(partial, manifest)
    except (ScenewrightError, OSError):
        for path in partial.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        return None
    return manifest


def keep(folder: Path, stage: Stage, key: str, made: Path) -> None:
    """Keep a copy of the artifact at `made`, and no more than four of this step. Does nothing where another run is
    writing it, or the folder cannot be written."""
    entry = shared_entry(folder, stage, key)
    try:
        with store.locked(entry), store.partial_folder(entry) as partial:
            shutil.copytree(made, partial, dirs_exist_ok=True, copy_function=_link)
            store.take_place(partial, entry)
        shared = sorted(folder.glob(f"{_prefix(stage)}*"), key=lambda path: path.stat().st_mtime_ns)
        for oldest in shared[:-KEPT]:
            shutil.rmtree(oldest, ignore_errors=True)
    except (MachineFailure, OSError):
        return


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def _prefix(stage: Stage) -> str:
    return stage.name.replace(" ", "-") + "-"

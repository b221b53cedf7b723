"""Steps from one schema version of a kind to the next. All are kept; each writes into a new folder.

A migration is a pure function `(old_folder, new_folder) -> None` that writes the payload of version n + 1 from that
of version n.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import LARGEST_DOCUMENT, file_json

Migration = Callable[[Path, Path], None]

MIGRATIONS: dict[tuple[str, int], Migration] = {}
"""(kind, from version) -> the step to the next version."""


def migration(kind: str, from_version: int) -> Callable[[Migration], Migration]:
    """Register a step from `from_version` to the next."""

    def register(function: Migration) -> Migration:
        MIGRATIONS[(kind, from_version)] = function
        return function

    return register


@migration("sequence", 1)
def sequence_of_several_cameras(old: Path, new: Path) -> None:
    """Version 2 lists its cameras; those of version 1 had one, called `camera`."""
    shutil.copytree(old, new, dirs_exist_ok=True, ignore=shutil.ignore_patterns("manifest.json"))
    path = old / "sequence.json"
    document = file_json(path, LARGEST_DOCUMENT, hint="make the artifact again")
    try:
        camera, frame_count = document["camera"], document["frame_count"]
        document["cameras"] = [{"name": "camera", "camera": camera, "baseline": None, "frame_count": frame_count}]
    except (KeyError, TypeError):
        raise BadInput(f"{path}: tells no camera and frame_count", hint="make the artifact again") from None
    (new / "sequence.json").write_text(json.dumps(document, sort_keys=True, indent=1) + "\n", encoding="utf-8")


@migration("sequence", 2)
def sequence_without_sources(old: Path, new: Path) -> None:
    """Version 3 may hold `sources.json` and two more streams; one of version 2 knows none of them."""
    shutil.copytree(old, new, dirs_exist_ok=True, ignore=shutil.ignore_patterns("manifest.json"))

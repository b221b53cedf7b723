"""Who looked at sealed rooms: a file for each look, written before anything can be seen."""

from __future__ import annotations

import subprocess
from datetime import UTC, datetime
from pathlib import Path

from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput

from benchmarks.board.records import RECORDS

LOOKS = RECORDS / "looks"


class Look(Model):
    """One look."""

    digest: str
    """Of the method."""
    commit: str
    day: str
    who: str


def note_look(digest: str, commit: str, folder: Path = LOOKS) -> Path:
    """Write that somebody looks at the sealed rooms of a method, and return the file; a look that goes on where one of
    the same day stopped is the same."""
    asked = subprocess.run(["git", "config", "user.name"], capture_output=True, text=True, check=False)
    day = datetime.now(UTC).date().isoformat()
    file = folder / f"{day}-{digest}.json"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        Look(digest=digest, commit=commit, day=day, who=asked.stdout.strip() or "unknown").write(file)
    return file


def read_looks(folder: Path = LOOKS) -> list[Look]:
    """Return all looks by day. Raises BadInput for a file that is none."""
    looks = []
    for file in sorted(folder.glob("*.json")):
        try:
            looks.append(Look.model_validate_json(file.read_bytes()))
        except ValidationError as error:
            raise BadInput(f"{file}: {error.errors()[0]['msg']}", hint="looks are written by `make board`") from None
    return looks

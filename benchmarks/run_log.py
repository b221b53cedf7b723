"""The log of a benchmark that goes on where it was stopped: one JSON line a trial."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

Row = TypeVar("Row", bound=BaseModel)


def whole_lines(path: Path) -> list[str]:
    """Return the lines of a log, none where there is no file; a line that was cut off at the end is taken out of it."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return [line for line in whole.split("\n") if line]


def read_log(path: Path, model: type[Row]) -> list[Row]:
    """Return the rows of a log, as `whole_lines` reads it. Raises pydantic's ValidationError for a line of another
    form."""
    return [model.model_validate_json(line) for line in whole_lines(path)]

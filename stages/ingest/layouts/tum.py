"""Not written yet."""

from __future__ import annotations

from pathlib import Path

from stages.ingest.parameters import IngestParameters
from stages.ingest.source import LogSource


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    return None


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """Not written yet."""
    raise NotImplementedError

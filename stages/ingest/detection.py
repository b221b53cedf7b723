"""Which format a log has."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from schemas.errors import BadInput
from stages.ingest import foxglove_log, posed_images, redwood, seven_scenes
from stages.ingest.parameters import IngestParameters
from stages.ingest.source import LogSource


class LogFormat(NamedTuple):
    """How a format is recognised and opened."""

    matches: Callable[[Path], str | None]
    open_source: Callable[[Path, IngestParameters, str], LogSource]


FORMATS = {
    "foxglove-mcap": LogFormat(foxglove_log.matches, foxglove_log.open_source),
    "7scenes": LogFormat(seven_scenes.matches, seven_scenes.open_source),
    "redwood": LogFormat(redwood.matches, redwood.open_source),
    "posed-images": LogFormat(posed_images.matches, posed_images.open_source),
}


def open_log(path: Path, parameters: IngestParameters) -> LogSource:
    """Recognise a log and list its frames. Raises BadInput when it is missing, of no known format, or damaged."""
    if not path.exists():
        raise BadInput(f"{path}: there is no such log")
    names = list(FORMATS) if parameters.format == "auto" else [parameters.format]
    for name in names:
        rule = FORMATS[name].matches(path)
        if rule is not None:
            return FORMATS[name].open_source(path, parameters, rule)
    what = "a file" if path.is_file() else "a folder with " + (_listing(path) or "nothing in it")
    raise BadInput(
        f"{path}: is not a log in a format that is known ({', '.join(names)}); it is {what}",
        hint="docs/LOGS.md describes the layouts",
    )


def _listing(path: Path) -> str:
    names = sorted(entry.name + ("/" if entry.is_dir() else "") for entry in path.iterdir())
    return ", ".join(names[:8]) + (f", ... ({len(names)} entries)" if len(names) > 8 else "")

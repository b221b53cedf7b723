"""Which format a log has."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from schemas.errors import BadInput
from stages.ingest.parameters import IngestParameters
from stages.ingest.source import LogSource


class LogFormat(NamedTuple):
    """How a format is recognised and opened."""

    matches: Callable[[Path], str | None]
    """Path -> the rule that matched, in words; None when the path is something else."""
    open_source: Callable[[Path, IngestParameters, str], LogSource]


MODULES = {
    "mcap": "messages.mcap_source",
    "rosbag1": "messages.rosbag1_source",
    "rosbag2": "messages.rosbag2_source",
    "nerfstudio": "layouts.nerfstudio",
    "scannet": "layouts.scannet",
    "colmap": "layouts.colmap",
    "scenenn": "layouts.scenenn",
    "tum": "layouts.tum",
    "7scenes": "layouts.seven_scenes",
    "redwood": "layouts.redwood",
    "posed-images": "layouts.posed_images",
    "images": "layouts.image_folder",
}
"""Format -> module with `matches` and `open_source`, in the order in which they are tried."""


def log_format(name: str) -> LogFormat:
    """Return the reader of a format; its module is loaded now."""
    module = importlib.import_module(f"stages.ingest.{MODULES[name]}")
    return LogFormat(module.matches, module.open_source)


def open_log(path: Path, parameters: IngestParameters) -> LogSource:
    """Recognise a log and list its frames. Raises BadInput when it is missing, of no known format, or damaged."""
    if not path.exists():
        raise BadInput(f"{path}: there is no such log", hint="check the path")
    names = list(MODULES) if parameters.format == "auto" else [parameters.format]
    for name in names:
        reader = log_format(name)
        rule = reader.matches(path)
        if rule is not None:
            return reader.open_source(path, parameters, rule)
    what = "a file" if path.is_file() else "a folder with " + (_listing(path) or "nothing in it")
    raise BadInput(
        f"{path}: is not a log in a format that is known ({', '.join(names)}); it is {what}",
        hint="docs/LOGS.md describes the layouts",
    )


def _listing(path: Path) -> str:
    names = sorted(entry.name + ("/" if entry.is_dir() else "") for entry in path.iterdir())
    return ", ".join(names[:8]) + (f", ... ({len(names)} entries)" if len(names) > 8 else "")

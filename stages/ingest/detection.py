"""Which format a log has."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.sequence import OF_TOPICS
from scenewright.stages.ingest.eye_order import settled_eyes
from scenewright.stages.ingest.foreign import (
    BY_ENDING,
    SHOWN,
    meant_to_be_read,
    refuse_foreign_file,
    refuse_lone_recording,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.registry import LogLayout, all_layouts
from scenewright.stages.ingest.source import LogSource

OF_ANY_IMAGES = "images"
"""The layout that matches any folder with images, and so those of other tools."""

MOST_LOOKED_AT = 200
"""Entries of a folder among which logs are looked for."""
TOPICS = ("color_topic", "depth_topic", "right_topic", "pose_topic")


class LogFormat(NamedTuple):
    """How a format is recognised and opened."""

    matches: Callable[[Path], str | None]
    """Path -> the rule that matched, in words; None when the path is something else."""
    open_source: Callable[[Path, IngestParameters, str], LogSource]


def log_format(layout: LogLayout) -> LogFormat:
    """Return the reader of a layout; its module is loaded now."""
    module = importlib.import_module(layout.reader)
    return LogFormat(module.matches, module.open_source)


def open_log(path: Path, parameters: IngestParameters) -> LogSource:
    """Recognise a log and list its frames. Raises BadInput when it is missing, of no known format, or damaged,
    and for a stereo pair whose pictures are exchanged."""
    if not path.exists():
        raise BadInput(f"{path}: there is no such log", hint="check the path")
    layouts = [layout for layout in all_layouts() if parameters.format in ("auto", layout.name)]
    guessed = parameters.format == "auto"
    if guessed and path.is_file():
        refuse_foreign_file(path)
    for layout in layouts:
        reader = log_format(layout)
        rule = reader.matches(path)
        if rule is not None and guessed and layout.name == OF_ANY_IMAGES:
            refuse_logs_within(path)
        if rule is not None:
            _check_topics(layout, parameters, path)
            source = reader.open_source(path, parameters, rule)
            try:
                return settled_eyes(source, str(path))
            except BaseException:
                source.close()
                raise
    if path.is_dir():
        refuse_logs_within(path)
        refuse_lone_recording(path)
    names = ", ".join(layout.name for layout in layouts)
    kind = "a file" if path.is_file() else "a folder with " + (_listing(path) or "nothing in it")
    raise BadInput(
        f"{path}: is not a log in a format that is known ({names}); it is {kind}",
        hint="docs/LOGS.md describes the layouts",
    )


def refuse_logs_within(root: Path) -> None:
    """Raise BadInput for a folder of recordings, naming them: one is meant. A calibration or poses beside images mean
    those."""
    if meant_to_be_read(root):
        return
    readers = [log_format(layout) for layout in all_layouts() if layout.name != OF_ANY_IMAGES]
    entries = sorted(entry for entry in root.iterdir() if not entry.name.startswith("."))[:MOST_LOOKED_AT]
    own = [entry for entry in entries if entry.suffix.lower() not in BY_ENDING]
    logs = [entry.name for entry in own if any(reader.matches(entry) for reader in readers)]
    if not logs:
        return
    listed = ", ".join(logs[:SHOWN]) + (", ..." if len(logs) > SHOWN else "")
    what = f"a log in {logs[0]}" if len(logs) == 1 else f"{len(logs)} logs, {listed}"
    raise BadInput(f"{root}: is not a log, but holds {what}", hint=f"give {root / logs[0]}")


def _check_topics(layout: LogLayout, parameters: IngestParameters, path: Path) -> None:
    given = [name for name in TOPICS if getattr(parameters, name) is not None]
    if given and layout.name not in OF_TOPICS:
        option = f"--{given[0].replace('_', '-')}"
        raise UsageError(f"{path}: {option} is for logs with topics, not for {layout.name}", hint="leave it out")


def _listing(path: Path) -> str:
    names = sorted(entry.name + ("/" if entry.is_dir() else "") for entry in path.iterdir())
    return ", ".join(names[:8]) + (f", ... ({len(names)} entries)" if len(names) > 8 else "")

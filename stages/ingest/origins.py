"""What the log itself calls the frames that were written, and those that were not."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from scenewright.schemas.sequence import FrameSources
from scenewright.stages.ingest.source import Entry

Value = TypeVar("Value", str, int)


def named_sources(written: Sequence[Entry], entries: Sequence[Entry], root: Path) -> FrameSources | None:
    """Return file names relative to `root` and stamps of the frames that were `written`, out of all `entries` of a log;
    None when the log has neither."""
    kept = {_place(entry) for entry in written}
    left_out = [_picture(entry, root) for entry in entries if _place(entry) not in kept]
    sources = FrameSources(
        color=_known(_relative(entry.files.color, root) for entry in written),
        depth=_known(_relative(entry.files.depth, root) for entry in written),
        stamps=_known(entry.stamp for entry in written),
        left_out=tuple(name for name in left_out if name is not None),
    )
    return sources if sources != FrameSources() else None


def _place(entry: Entry) -> tuple[str, float, str]:
    """What tells the entries of a log apart: selection and conversion change the pose alone."""
    return entry.camera_name, entry.time, entry.name


def _picture(entry: Entry, root: Path) -> str | None:
    return _relative(entry.files.color, root) or _relative(entry.files.depth, root)


def _relative(path: Path | None, root: Path) -> str | None:
    """Return a file's name below the log, readable in any JSON: what is no UTF-8 in it is replaced."""
    return None if path is None else os.fsencode(path.relative_to(root).as_posix()).decode("utf-8", "replace")


def _known(values: Iterable[Value | None]) -> tuple[Value | None, ...]:
    """Return the values, nothing when none is known."""
    listed = tuple(values)
    return listed if any(value is not None for value in listed) else ()

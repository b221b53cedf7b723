"""Opens a log and loads its frames without the rest of the step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import LoadedFrame, LogSource
from scenewright.stages.kit.formats.foxglove import decode_color


def loaded_frames(log: Path, **options: Any) -> tuple[LogSource, list[LoadedFrame]]:
    """Return the source and all its frames, colour and right eye decoded to (H, W, 3) uint8 RGB."""
    source = open_log(log, IngestParameters(**options))
    try:
        frames = [entry.load() for entry in source.entries]
    finally:
        source.close()
    return source, [replace(frame, color=_pixels(frame.color), right=_pixels(frame.right)) for frame in frames]


def _pixels(image: Any) -> Any:
    return decode_color(image) if isinstance(image, bytes) else image

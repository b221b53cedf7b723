"""Frames of the input: colour, depth, segments."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.stages.report.frames import frame_views
from scenewright.stages.report.page import Page


def view(page: Page) -> dict[str, Any] | None:
    """Return cards of some frames, and how the log was read; None without a sequence, or when it has no frames."""
    sequence, segments = page.given("sequence", Sequence), page.given("segments", Segments)
    if sequence is None:
        return None
    info = sequence.info
    views, legend = frame_views(sequence, segments, page.parameters.frames, page.parameters.frame_width)
    dropped = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in sorted(info.drops.items()) if count)
    text = f"{info.frame_count} of {info.frames_in_log} frames of the log were used"
    text += f" ({dropped} left out). " if dropped else ". "
    gravity = info.gravity.method.replace("_", " ")
    text += f"Read as {info.source_format}; which way is up: {gravity}. "
    has_segments = any(each.segments for each in views)
    text += "Each card: colour, depth (yellow near, blue far)" + (", segments." if has_segments else ".")
    return {"frames": views, "legend": legend, "frames_text": text} if views else None

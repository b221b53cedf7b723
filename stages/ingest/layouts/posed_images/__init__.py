"""Folders of posed images."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "posed-images",
    order=110,
    recognised_by="color|rgb|image/, depth/ and a list of poses with seven numbers a line",
    reader=f"{__name__}.reader",
)

"""7-Scenes folders."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout("7scenes", order=90, recognised_by="frame-<number>.depth.png files", reader=f"{__name__}.reader")

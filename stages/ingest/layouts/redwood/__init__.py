"""Redwood / Open3D folders."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "redwood", order=100, recognised_by="image|color|rgb/, depth/ and trajectory.log", reader=f"{__name__}.reader"
)

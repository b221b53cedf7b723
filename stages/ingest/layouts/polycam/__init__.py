"""Polycam's raw export: key frames with their cameras, depth and confidence."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout("polycam", order=58, recognised_by="keyframes/ with cameras/*.json", reader=f"{__name__}.reader")

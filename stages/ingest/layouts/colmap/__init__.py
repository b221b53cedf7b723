"""COLMAP projects."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "colmap", order=60, recognised_by="cameras and images files of a sparse model", reader=f"{__name__}.reader"
)

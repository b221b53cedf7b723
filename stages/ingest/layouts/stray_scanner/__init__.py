"""Stray Scanner's recordings."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "stray-scanner", order=56, recognised_by="odometry.csv and camera_matrix.csv", reader=f"{__name__}.reader"
)

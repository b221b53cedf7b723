"""All data of the 3D Scanner App: pictures, depth and confidence, each with a JSON file of its camera."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "scanner-app", order=59, recognised_by="frame_00000.json with cameraPoseARFrame", reader=f"{__name__}.reader"
)

"""SceneNN folders."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "scenenn",
    order=70,
    recognised_by="image|rgb/, depth/, trajectory.log and timestamp.txt, asus.ini or depth/depth<number>.png",
    reader=f"{__name__}.reader",
)

"""nerfstudio, and folders of the Replica rendering."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "nerfstudio",
    order=40,
    recognised_by="transforms.json, or traj.txt with results/frame*",
    reader=f"{__name__}.reader",
)

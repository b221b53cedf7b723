"""Record3D's recordings: .r3d, the same unpacked, and the export as EXR and JPG."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "record3d",
    order=57,
    recognised_by=".r3d, or metadata(.json) with K and poses and rgbd/ or rgb/",
    reader=f"{__name__}.reader",
)

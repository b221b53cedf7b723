"""TUM RGB-D folders."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout("tum", order=80, recognised_by="rgb.txt, or a file of associations", reader=f"{__name__}.reader")

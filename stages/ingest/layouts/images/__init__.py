"""Plain images with a calibration file."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout("images", order=120, recognised_by="image files, or one video", reader=f"{__name__}.reader")

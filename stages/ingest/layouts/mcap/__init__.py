"""MCAP logs: ROS 2, ROS 1 or Foxglove messages."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout("mcap", order=10, recognised_by="a file with the MCAP magic", reader=f"{__name__}.reader")

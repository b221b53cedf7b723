"""ROS 2 bags."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout(
    "rosbag2", order=30, recognised_by="a folder with metadata.yaml, or an SQLite file", reader=f"{__name__}.reader"
)

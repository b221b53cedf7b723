"""ROS 1 bags."""

from __future__ import annotations

from scenewright.stages.ingest.registry import LogLayout

LAYOUT = LogLayout("rosbag1", order=20, recognised_by="a file with the magic of ROS bags", reader=f"{__name__}.reader")

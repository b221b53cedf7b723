"""ROS 2 bags: folders with metadata.yaml, and single SQLite files."""

from __future__ import annotations

from pathlib import Path

from scenewright.stages.ingest.messages.message_source import open_messages
from scenewright.stages.ingest.messages.opening import container_of
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import LogSource


def matches(path: Path) -> str | None:
    """Return the rule that matched, or None."""
    return "folder or file of rosbag2: ROS 2 bag" if container_of(path) == "rosbag2" else None


def open_source(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """Survey a ROS 2 bag and list its frames. Raises BadInput as `open_messages` does."""
    return open_messages(path, parameters, rule)

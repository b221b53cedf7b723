"""MCAP with ROS 2 messages (CDR, embedded ros2msg schemas): what `ros2 bag`, RViz and Foxglove open."""

from __future__ import annotations

from scenewright.stages.export.registry import STREAMS, SequenceFormat

FORMAT = SequenceFormat(
    name="ros2",
    order=40,
    layout="mcap",
    dialect="ros2",
    summary="ROS 2 (CDR) for ros2 bag and RViz",
    streams=STREAMS,
    log="log.mcap",
)

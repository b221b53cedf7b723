"""Writing an MCAP file of ROS 2 messages (CDR, embedded ros2msg schemas) as a ROS 2 recorder would."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.typesys import Stores, get_typestore


@cache
def ros2_types() -> Any:
    """Return the message types of ROS 2 Humble: `.types[NAME](...)` makes a message."""
    return get_typestore(Stores.ROS2_HUMBLE)


def ros2_header(stamp: int, frame_id: str) -> Any:
    """Return a std_msgs/Header, stamped `stamp` [ns]."""
    types = ros2_types().types
    time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    return types["std_msgs/msg/Header"](stamp=time, frame_id=frame_id)


class BagWriter:
    """An MCAP file in the profile of rosbag2; schemas and channels are registered when they first occur."""

    def __init__(self, path: Path, metadata: Mapping[str, dict[str, str]]) -> None:
        self._file = path.open("wb")
        self._writer = McapWriter(self._file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="scenewright")
        for name, table in metadata.items():
            self._writer.add_metadata(name, table)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._writer.finish()
        self._file.close()

    def add(self, topic: str, message: Any, stamp: int, sequence: int) -> None:
        """Append a message at `stamp` [ns]."""
        name = message.__msgtype__
        if name not in self._schemas:
            text, _ = ros2_types().generate_msgdef(name, ros_version=2)
            self._schemas[name] = self._writer.register_schema(name, "ros2msg", text.encode())
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[name])
        data = bytes(ros2_types().serialize_cdr(message, name))
        self._writer.add_message(self._channels[topic], stamp, data, publish_time=stamp, sequence=sequence)

"""What every container of messages (MCAP, rosbag1, rosbag2) looks like to the rest of ingest."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol


@dataclass(frozen=True)
class Channel:
    """One channel: a topic with the type and encoding of its messages."""

    id: int
    topic: str
    type_name: str
    """As the container has it: `sensor_msgs/msg/Image`, `sensor_msgs/Image`, `foxglove.RawImage`."""
    message_encoding: str
    """`cdr`, `ros1`, `protobuf`, `json`, or what the container says."""
    schema_encoding: str
    """`ros2msg`, `ros2idl`, `ros1msg`, `protobuf`, `jsonschema`, or empty."""
    schema: bytes
    """The definition that the container embeds; empty when there is none."""
    count: int | None = None
    """Messages, where the container knows without reading."""


@dataclass(frozen=True)
class StoredMessage:
    """One message as bytes."""

    channel: Channel
    log_time: int
    """[ns]"""
    data: bytes
    location: Hashable
    """What `fetch` needs to find it again."""


class MessageLog(Protocol):
    """A log that is open for reading. One chunk, or one message, is in memory at a time."""

    path: Path
    format: str
    """`mcap`, `rosbag1` or `rosbag2`."""
    channels: tuple[Channel, ...]
    metadata: dict[str, dict[str, str]]
    """Metadata records by name (MCAP); empty elsewhere."""
    damage: list[str]
    """What could not be read, one line each; complete after `messages` has been read to its end once."""
    notes: list[str]
    """What cannot be known of the log, for people: parts without checksums, a metadata.yaml that is missing."""

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield messages of the channels (None: all) in file order. Damaged parts are skipped and noted in `damage`
        when the log was opened with `salvage`, otherwise they raise BadInput."""
        ...

    def fetch(self, location: Hashable) -> StoredMessage:
        """Return the message at a location that `messages` gave. Raises BadInput when it has become unreadable."""
        ...

    def close(self) -> None:
        """Close the files."""
        ...

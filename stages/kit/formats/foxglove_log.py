"""Writing MCAP logs of Foxglove protobuf messages; the same messages give the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from google.protobuf.message import Message
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import build_file_descriptor_set

AddMessage = Callable[[str, int, Message], None]
"""Topic, time [ns], message."""


@contextmanager
def foxglove_log(path: Path, topics: Mapping[str, type[Message]]) -> Iterator[AddMessage]:
    """Open a new log for a `with` block; what it gives adds a message. `topics`: topic -> class of its messages."""
    with Path(path).open("wb") as file:
        writer = McapWriter(file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        writer.start(profile="", library="scenewright")
        channels = {}
        for topic, kind in topics.items():
            data = build_file_descriptor_set(kind).SerializeToString(deterministic=True)
            schema = writer.register_schema(kind.DESCRIPTOR.full_name, "protobuf", data)
            channels[topic] = writer.register_channel(topic, "protobuf", schema)

        def add(topic: str, stamp: int, message: Message) -> None:
            data = message.SerializeToString(deterministic=True)
            writer.add_message(channels[topic], stamp, data, publish_time=stamp)

        yield add
        writer.finish()

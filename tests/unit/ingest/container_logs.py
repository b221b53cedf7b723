"""Writes small logs in every container, and takes them apart; messages are (topic, log time [ns], bytes)."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from scenewright.stages.ingest.messages.container import MessageLog
from scenewright.stages.ingest.messages.mcap_records import MAGIC

Message = tuple[str, int, bytes]
DEFINITION = "string data\n"


def some_messages(number: int = 40, size: int = 200) -> list[Message]:
    """Return messages of two topics, every one with bytes of its own that pack badly."""
    messages = []
    for index in range(number):
        noise = bytes((index * 37 + place * place * 11) % 256 for place in range(size))
        messages.append(("/a" if index % 3 else "/b", 1_000_000_000 + index * 1000, struct.pack("<I", index) + noise))
    return messages


def write_mcap(path: Path, messages: list[Message], *, chunk_size: int = 1000, **options: Any) -> Path:
    """Write an MCAP file with channels of schemas `Type_a` and so on, a metadata record and an attachment."""
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=chunk_size, **options)
        writer.start(profile="test")
        writer.add_metadata("first", {"key": "value"})
        channels: dict[str, int] = {}
        for topic, time, data in messages:
            if topic not in channels:
                schema = writer.register_schema("Type" + topic.replace("/", "_"), "ros2msg", DEFINITION.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], time, data, time)
        writer.add_attachment(0, 0, "photograph", "text/plain", b"attached")
        writer.add_metadata("first", {"key": "other"})
        writer.finish()
    return path


def write_bag1(path: Path, messages: list[Message], *, packing: str = "none", chunk_size: int = 1000) -> Path:
    """Write a ROS 1 bag; `packing` is none, bz2 or lz4."""
    writer = Bag1Writer(path)
    writer.chunk_threshold = chunk_size
    if packing != "none":
        writer.set_compression(Bag1Writer.CompressionFormat[packing.upper()])
    with writer:
        connections: dict[str, Any] = {}
        for topic, time, data in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, "std_msgs/msg/String", msgdef=DEFINITION, md5sum="0" * 32
                )
            writer.write(connections[topic], time, data)
    return path


def write_bag2(
    path: Path,
    messages: list[Message],
    *,
    storage: StoragePlugin = StoragePlugin.SQLITE3,
    mode: CompressionMode = CompressionMode.NONE,
) -> Path:
    """Write a rosbag2 folder of one part."""
    writer = Bag2Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, time, data in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, "std_msgs/msg/String", msgdef=DEFINITION, rihs01="RIHS01_" + "0" * 64
                )
            writer.write(connections[topic], time, data)
    return path


def read_messages(log: MessageLog) -> list[Message]:
    """Read a log to its end."""
    return [(message.channel.topic, message.log_time, message.data) for message in log.messages()]


def mcap_records(data: bytes) -> list[tuple[int, int, int]]:
    """Return (opcode, start, end) of the top-level records of an MCAP file."""
    found, offset = [], len(MAGIC)
    while offset < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, offset)
        found.append((opcode, offset, offset + 9 + length))
        offset += 9 + length
    return found


def bag1_records(data: bytes) -> list[tuple[int, int, int]]:
    """Return (op, start, end) of the top-level records of a ROS 1 bag."""
    found, offset = [], len(b"#ROSBAG V2.0\n")
    while offset < len(data):
        (header,) = struct.unpack_from("<I", data, offset)
        (length,) = struct.unpack_from("<I", data, offset + 4 + header)
        end = offset + 8 + header + length
        op = data[data.index(b"op=", offset, offset + 4 + header) + 3]
        found.append((op, offset, end))
        offset = end
    return found


def mcap_record(opcode: int, body: bytes) -> bytes:
    """Return a record as bytes."""
    return struct.pack("<BQ", opcode, len(body)) + body


def mcap_channel(number: int, topic: str, schema: int = 0) -> bytes:
    """Return a Channel record as bytes."""
    name = topic.encode()
    body = struct.pack("<HHI", number, schema, len(name)) + name + struct.pack("<I", 4) + b"json" + struct.pack("<I", 0)
    return mcap_record(Opcode.CHANNEL, body)


def mcap_message(channel: int, time: int, data: bytes) -> bytes:
    """Return a Message record as bytes."""
    return mcap_record(Opcode.MESSAGE, struct.pack("<HIQQ", channel, 0, time, time) + data)


def mcap_chunk(content: bytes, claimed: int | None = None, compression: bytes = b"", checksum: int = 0) -> bytes:
    """Return a Chunk record as bytes; `claimed` is the unpacked size it states."""
    body = struct.pack("<QQQI", 0, 0, len(content) if claimed is None else claimed, checksum)
    body += struct.pack("<I", len(compression)) + compression + struct.pack("<Q", len(content)) + content
    return mcap_record(Opcode.CHUNK, body)


def mcap_file(*records: bytes) -> bytes:
    """Return a file of these records between a header and an end without a summary."""
    header = mcap_record(Opcode.HEADER, struct.pack("<II", 0, 0))
    end = mcap_record(Opcode.DATA_END, bytes(4)) + mcap_record(Opcode.FOOTER, bytes(20))
    return MAGIC + header + b"".join(records) + end + MAGIC


__all__ = ["CompressionMode", "CompressionType", "IndexType", "StoragePlugin"]

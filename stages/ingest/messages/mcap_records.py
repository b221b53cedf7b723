"""Records of MCAP files: parsed within their bounds, and found again after a damaged place.

The parser of the mcap package returns what is there when a field claims more, so that a lie goes unnoticed. Source of
the layouts: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema
from scenewright.stages.ingest.messages.log_file import Damaged, LogFile

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
"""Opcode and length of every record."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
FOOTER_SIZE = 20
"""Bytes of an MCAP footer without its record head (MCAP specification)."""
DATA_END_SIZE = 4
"""Bytes of an MCAP data-end record without its record head (MCAP specification)."""
COMPRESSIONS = ("", "lz4", "zstd")
_CHUNK = struct.Struct("<QQQI")
_LONGEST_CHUNK_HEAD = _CHUNK.size + 4 + 64 + 8
"""Bytes of a chunk's head with the longest name of a compression that is read."""
_WINDOW = 4 << 20
"""Bytes that are searched at a time for a chunk; by eye."""


class _Fields:
    """Reads the fields of a record's body one after the other. Raises Damaged at the first that is not there."""

    def __init__(self, body: bytes) -> None:
        self._body = body
        self._position = 0

    def take(self, length: int) -> bytes:
        piece = self._body[self._position : self._position + length]
        if len(piece) != length:
            raise Damaged(f"claims a field of {length} bytes and has {len(piece)} left")
        self._position += length
        return piece

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        try:
            return self.take(self.number(4)).decode()
        except UnicodeDecodeError:
            raise Damaged("holds text that is not UTF-8") from None

    def texts(self) -> dict[str, str]:
        inside = _Fields(self.take(self.number(4)))
        text_of = {}
        while inside._position < len(inside._body):
            key = inside.text()
            text_of[key] = inside.text()
        return text_of


def read_header(body: bytes) -> str:
    """Return the profile of a Header record (`ros1`, `ros2`, empty)."""
    return _Fields(body).text()


def read_schema(body: bytes) -> Schema:
    """Return a Schema record. Raises Damaged."""
    fields = _Fields(body)
    number, name, encoding = fields.number(2), fields.text(), fields.text()
    return Schema(id=number, name=name, encoding=encoding, data=fields.take(fields.number(4)))


def read_channel(body: bytes) -> Channel:
    """Return a Channel record. Raises Damaged."""
    fields = _Fields(body)
    number, schema, topic, encoding = fields.number(2), fields.number(2), fields.text(), fields.text()
    return Channel(id=number, schema_id=schema, topic=topic, message_encoding=encoding, metadata=fields.texts())


def read_metadata(body: bytes) -> tuple[str, dict[str, str]]:
    """Return name and map of a Metadata record. Raises Damaged."""
    fields = _Fields(body)
    return fields.text(), fields.texts()


def read_footer(body: bytes) -> Footer:
    """Return a Footer record. Raises Damaged."""
    fields = _Fields(body)
    return Footer(summary_start=fields.number(8), summary_offset_start=fields.number(8), summary_crc=fields.number(4))


def read_statistics(body: bytes) -> tuple[int, int, dict[int, int]]:
    """Return the number of messages, of channels, and messages by channel of a Statistics record. Raises Damaged."""
    fields = _Fields(body)
    messages, _, channels = fields.number(8), fields.number(2), fields.number(4)
    fields.take(4 + 4 + 4 + 8 + 8)
    inside = _Fields(fields.take(fields.number(4)))
    counts = {}
    while inside._position < len(inside._body):
        channel = inside.number(2)
        counts[channel] = inside.number(8)
    return messages, channels, counts


def read_chunk_index(body: bytes) -> int:
    """Return the offset of the chunk that a ChunkIndex record names. Raises Damaged."""
    fields = _Fields(body)
    fields.take(16)
    return fields.number(8)


@dataclass(frozen=True)
class ChunkHead:
    """What stands before the packed bytes of a chunk."""

    start: int
    """Offset of the packed bytes in the file."""
    packed_size: int
    size: int
    """Bytes it claims to hold when unpacked."""
    checksum: int
    """CRC-32 of the unpacked bytes; 0 = the writer made none."""
    compression: str


def read_chunk_head(file: LogFile, offset: int, length: int) -> ChunkHead:
    """Return the head of the Chunk record at `offset` whose body has `length` bytes. Raises Damaged."""
    fields = _Fields(file.exactly(offset + HEAD.size, min(length, _LONGEST_CHUNK_HEAD)))
    _, _, size, checksum = _CHUNK.unpack(fields.take(_CHUNK.size))
    name = fields.take(fields.number(4))
    packed_size = fields.number(8)
    head = _CHUNK.size + 4 + len(name) + 8
    if head + packed_size != length:
        raise Damaged(f"claims {packed_size} packed bytes and has room for {length - head}")
    return ChunkHead(offset + HEAD.size + head, packed_size, size, checksum, name.decode("ascii", "replace"))


def find_chunk(file: LogFile, start: int) -> int | None:
    """Return the offset of the first thing from `start` on that can only be a whole Chunk record, or None.

    A chunk states its length three times (record, packed bytes, name of the compression), which no other bytes do by
    chance.
    """
    head = HEAD.size + _CHUNK.size
    overlap = head + 4 + 4 + 8
    for begin in range(start, file.size, _WINDOW):
        try:
            window = np.frombuffer(file.read(begin, _WINDOW + overlap), np.uint8)
        except Damaged:  # a part of the disk that cannot be read
            continue
        last = len(window) - head - 4
        if last <= 0:
            return None
        places = np.flatnonzero(window[:last] == Opcode.CHUNK)
        plausible = (window[places + head] <= 4) & (window[places + head + 1] == 0) & (window[places + 8] == 0)
        for candidate in places[plausible]:
            if candidate < _WINDOW and _is_chunk(
                window[candidate : candidate + overlap].tobytes(), begin + int(candidate), file.size
            ):
                return begin + int(candidate)
    return None


def _is_chunk(head: bytes, offset: int, stop: int) -> bool:
    _, length = HEAD.unpack_from(head)
    fields = _Fields(head[HEAD.size + _CHUNK.size :])
    try:
        name = fields.text()
        packed_size = fields.number(8)
    except Damaged:
        return False
    described = _CHUNK.size + 4 + len(name) + 8 + packed_size
    return name in COMPRESSIONS and length == described and offset + HEAD.size + length <= stop


def find_data_end(file: LogFile) -> int | None:
    """Return the offset of the DataEnd record, found from the end of the file; None where that is cut."""
    footer = file.size - len(MAGIC) - FOOTER_SIZE - HEAD.size
    if footer < len(MAGIC):
        return None
    tail = file.exactly(footer, HEAD.size + FOOTER_SIZE + len(MAGIC))
    if not tail.endswith(MAGIC) or HEAD.unpack_from(tail) != (Opcode.FOOTER, FOOTER_SIZE):
        return None
    start = read_footer(tail[HEAD.size : HEAD.size + FOOTER_SIZE]).summary_start or footer
    offset = start - HEAD.size - DATA_END_SIZE
    if not len(MAGIC) <= offset < footer:
        return None
    return offset if HEAD.unpack(file.exactly(offset, HEAD.size)) == (Opcode.DATA_END, DATA_END_SIZE) else None

"""MCAP files of our own artifacts, through the mcap package: random access to what is indexed.

An artifact's hash was checked before a step reads it, so nothing is searched for or saved here: a file that lacks its
summary, an index or a chunk is refused as a whole. Damaged logs of other people are read by `stages/ingest/messages`.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, MessageIndex, Schema
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.formats.bounded_unpacking import unpacked
from scenewright.stages.kit.formats.chunk_cache import ChunkCache

HINT = "make the artifact again; `scenewright verify` tells which file changed"
LARGEST_CHUNK = 256 << 20
"""Most unpacked bytes of a chunk; our writers close a chunk after 1 MiB and one message."""
_HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""
_MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time; the payload follows."""
_UNREADABLE = (McapError, ValueError, OSError, struct.error, KeyError, OverflowError, StopIteration)
"""What the mcap package raises for records that are cut short or lie."""


@dataclass(frozen=True, slots=True)
class Location:
    """Where a message stands: the number of its chunk, and the offset of its record in the unpacked chunk."""

    chunk: int
    offset: int


class IndexedMcap:
    """An MCAP file with summary and message indexes, open for reading; a context manager.

    Raises BadInput, when opened or read, for a file that has none, or whose records are not what the summary says.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._file = opened(self.path, hint=HINT)
        try:
            reader = SeekingReader(self._file, record_size_limit=LARGEST_CHUNK)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                raise ValueError("it was not closed")
            if summary.statistics.message_count and not summary.chunk_indexes:
                raise ValueError("it has no index")
            self.channels: dict[int, Channel] = summary.channels
            self.schemas: dict[int, Schema] = summary.schemas
            self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}
            self._chunks: list[ChunkIndex] = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
        except _UNREADABLE as error:
            self._file.close()
            raise self._bad(error) from None
        self._cache = ChunkCache()

    def __enter__(self) -> IndexedMcap:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        self._cache.clear()

    def indexed(self, channel: int) -> Iterator[tuple[int, Location]]:
        """Yield log time [ns] and place of every message of a channel, chunk by chunk. Raises BadInput."""
        for number, chunk in enumerate(self._chunks):
            if channel not in chunk.message_index_offsets:
                continue
            try:
                self._file.seek(chunk.message_index_offsets[channel] + _HEAD.size)
                index = MessageIndex.read(ReadDataStream(self._file))
            except _UNREADABLE as error:
                raise self._bad(error) from None
            for stamp, offset in index.records:
                yield stamp, Location(number, offset)

    def fetch(self, location: Location) -> bytes:
        """Return the payload of the message at a place that `indexed` gave. Raises BadInput where there is none."""
        data = self._cache.get(location.chunk, self._unpack)
        end = location.offset + _HEAD.size
        if end > len(data):
            raise self._bad("holds no message where the index says")
        opcode, length = _HEAD.unpack_from(data, location.offset)
        if opcode != Opcode.MESSAGE or length < _MESSAGE.size or end + length > len(data):
            raise self._bad("holds no message where the index says")
        return data[end + _MESSAGE.size : end + length]

    def _unpack(self, number: int) -> bytes:
        index = self._chunks[number]
        try:
            if max(index.uncompressed_size, index.chunk_length) > LARGEST_CHUNK:
                raise ValueError(f"claims a chunk of {index.uncompressed_size} bytes")
            self._file.seek(index.chunk_start_offset + _HEAD.size)
            # Read as a piece: what the record claims of its own length can then not ask for more.
            chunk = Chunk.read(ReadDataStream(BytesIO(self._file.read(index.chunk_length))))
            if chunk.uncompressed_size != index.uncompressed_size:
                raise ValueError("has a chunk of another size than its index says")
            data = unpacked(chunk.data, chunk.compression, chunk.uncompressed_size)
            if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
                raise ValueError(f"has a chunk with a wrong checksum, at byte {index.chunk_start_offset}")
        except _UNREADABLE as error:
            raise self._bad(error) from None
        return data

    def _bad(self, fault: Exception | str) -> BadInput:
        detail = str(fault) or type(fault).__name__
        return BadInput(f"{self.path}: is not a whole MCAP file of ours: {detail:.200}", hint=HINT)

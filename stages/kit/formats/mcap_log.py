"""MCAP files, record by record: structure checked when opened, checksums when read, memory flat.

The reader of the mcap package neither checks checksums by default nor says where a torn file ends, and it loads a
file without an index whole. This one walks the records once (without unpacking chunks), so that a damaged file is
refused before work starts. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, MessageIndex, Metadata, Schema

from schemas.errors import BadInput

MAGIC = b"\x89MCAP0\r\n"
LARGEST_CHUNK = 1 << 30
"""Uncompressed bytes of one chunk that are accepted; what claims more is refused as a decompression bomb."""
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")
HINT = "copy the log again, or repair it with `mcap recover`"


@dataclass(frozen=True)
class Location:
    """Where a message stands: `chunk` is an index into the chunks, or -1 for a message outside of chunks."""

    chunk: int
    offset: int


@dataclass(frozen=True)
class LogMessage:
    """One message: its channel, log time [ns], payload and where it stands."""

    channel: Channel
    log_time: int
    data: bytes
    location: Location


@dataclass(frozen=True)
class _ChunkPlace:
    start: int
    """Offset of the compressed data in the file."""
    compressed_size: int
    uncompressed_size: int
    checksum: int
    compression: str
    offset: int
    """Offset of the chunk record, for error messages."""


class McapLog:
    """A structurally whole MCAP file, open for reading. Raises BadInput for anything that is torn or lies."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.message_index: dict[int, list[tuple[int, Location]]] = {}
        """Channel id -> (log time, where), as far as the file has message indexes."""
        self._chunks: list[_ChunkPlace] = []
        self._loose: list[int] = []
        self._cache: dict[int, bytes] = {}
        try:
            self._file: BinaryIO = self.path.open("rb")
        except FileNotFoundError:
            raise BadInput(f"{self.path}: file is missing") from None
        except IsADirectoryError:
            raise BadInput(f"{self.path}: is a folder, expected an MCAP file") from None
        try:
            self._size = self.path.stat().st_size
            self._walk()
            if not self.channels:
                self._find_channels()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> McapLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        self._cache.clear()

    def channel_ids(self, topic: str) -> list[int]:
        """Return the ids of the channels with this topic."""
        return sorted(channel.id for channel in self.channels.values() if channel.topic == topic)

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[LogMessage]:
        """Yield messages of the channels (all of them: None) in file order; one chunk is in memory at a time."""
        wanted = None if channel_ids is None else set(channel_ids)
        for index in range(len(self._chunks)):
            data = self._unpack(index)
            for opcode, start, length in self._records(data, index):
                if opcode == Opcode.MESSAGE:
                    message = self._message(data, start, length, Location(index, start), wanted)
                    if message is not None:
                        yield message
        for offset in self._loose:
            body = self._loose_body(offset)
            message = self._message(body, 0, len(body), Location(-1, offset), wanted)
            if message is not None:
                yield message

    def fetch(self, location: Location) -> LogMessage:
        """Return the message at a location that `messages` or `message_index` gave; a few chunks are kept unpacked."""
        if location.chunk < 0:
            body, start = self._loose_body(location.offset), 0
            length = len(body)
        else:
            body = self._cached(location.chunk)
            if location.offset + _RECORD.size > len(body):
                raise self._bad(f"message index points outside of chunk {location.chunk}")
            start = location.offset
            opcode, length = _RECORD.unpack_from(body, start - _RECORD.size)
            if opcode != Opcode.MESSAGE or start + length > len(body):
                raise self._bad(f"message index points to no message in chunk {location.chunk}")
        message = self._message(body, start, length, location, None)
        assert message is not None
        return message

    # --- structure -------------------------------------------------------------------------------------------

    def _walk(self) -> None:
        """Visit every top-level record, checking that each lies within the file, up to the footer and the magic."""
        if self._size < len(MAGIC) or self._file.read(len(MAGIC)) != MAGIC:
            raise self._bad("is no MCAP file (wrong first bytes)")
        offset, data_end, footer, last_chunk = len(MAGIC), None, None, -1
        while footer is None:
            self._file.seek(offset)
            head = self._file.read(_RECORD.size)
            if len(head) < _RECORD.size:
                raise self._torn(offset)
            opcode, length = _RECORD.unpack(head)
            body = offset + _RECORD.size
            if body + length > self._size:
                raise self._torn(offset)
            if opcode == Opcode.CHUNK:
                self._chunks.append(self._chunk_place(offset, length))
                last_chunk = len(self._chunks) - 1
            elif opcode == Opcode.MESSAGE:
                self._loose.append(body)
            elif opcode == Opcode.MESSAGE_INDEX and data_end is None:
                record = self._parse(MessageIndex, offset, length)
                entries = self.message_index.setdefault(record.channel_id, [])
                entries.extend((time, Location(last_chunk, place + _RECORD.size)) for time, place in record.records)
            elif opcode == Opcode.SCHEMA:
                schema = self._parse(Schema, offset, length)
                self.schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = self._parse(Channel, offset, length)
                self.channels[channel.id] = channel
            elif opcode == Opcode.METADATA:
                metadata = self._parse(Metadata, offset, length)
                self.metadata.append((metadata.name, dict(metadata.metadata)))
            elif opcode == Opcode.DATA_END:
                data_end = body + length
            elif opcode == Opcode.FOOTER:
                footer = self._parse(Footer, offset, length)
            offset = body + length
        if data_end is None:
            raise self._bad(f"footer at byte {offset} without an end of data before it")
        self._file.seek(offset)
        if self._file.read() != MAGIC:
            raise self._bad(f"has no closing magic after the footer at byte {offset}")
        self._check_summary(footer)

    def _check_summary(self, footer: Footer) -> None:
        start = footer.summary_start or footer.summary_offset_start
        end = self._size - len(MAGIC) - 4
        if footer.summary_crc and start:
            if not 0 < start <= end:
                raise self._bad(f"summary starts at byte {start} of {self._size}")
            self._file.seek(start)
            if zlib.crc32(self._file.read(end - start)) != footer.summary_crc:
                raise self._bad("checksum of the summary is wrong: the file is damaged")

    def _chunk_place(self, offset: int, length: int) -> _ChunkPlace:
        self._file.seek(offset + _RECORD.size)
        head = self._file.read(min(length, _CHUNK.size + 4))
        if len(head) < _CHUNK.size + 4:
            raise self._bad(f"chunk at byte {offset} is shorter than its header")
        _, _, uncompressed_size, checksum = _CHUNK.unpack_from(head)
        name_length = struct.unpack_from("<I", head, _CHUNK.size)[0]
        if name_length > 64 or _CHUNK.size + 4 + name_length + 8 > length:
            raise self._bad(f"chunk at byte {offset} is damaged")
        name = self._file.read(name_length)
        (compressed_size,) = struct.unpack("<Q", self._file.read(8))
        start = offset + _RECORD.size + _CHUNK.size + 4 + name_length + 8
        if start + compressed_size != offset + _RECORD.size + length:
            raise self._bad(f"chunk at byte {offset} claims {compressed_size} bytes that it does not hold")
        if uncompressed_size > LARGEST_CHUNK:
            raise self._bad(f"chunk at byte {offset} claims {uncompressed_size} bytes, more than {LARGEST_CHUNK}")
        compression = name.decode("ascii", "replace")
        return _ChunkPlace(start, compressed_size, uncompressed_size, checksum, compression, offset)

    def _find_channels(self) -> None:
        """Collect schemas and channels from the chunks of a file that does not repeat them in its summary."""
        for index in range(len(self._chunks)):
            data = self._unpack(index)
            for opcode, start, length in self._records(data, index):
                if opcode == Opcode.SCHEMA:
                    schema = self._record(Schema, data[start : start + length], self._chunks[index].offset)
                    self.schemas[schema.id] = schema
                elif opcode == Opcode.CHANNEL:
                    channel = self._record(Channel, data[start : start + length], self._chunks[index].offset)
                    self.channels[channel.id] = channel

    # --- reading ---------------------------------------------------------------------------------------------

    def _cached(self, index: int) -> bytes:
        if index not in self._cache:
            while len(self._cache) >= 4:
                self._cache.pop(next(iter(self._cache)))
            self._cache[index] = self._unpack(index)
        return self._cache[index]

    def _unpack(self, index: int) -> bytes:
        place = self._chunks[index]
        self._file.seek(place.start)
        packed = self._file.read(place.compressed_size)
        try:
            if place.compression == "zstd":
                if zstandard.frame_content_size(packed) not in (-1, place.uncompressed_size):
                    raise self._bad(f"chunk at byte {place.offset} lies about its size")
                data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=place.uncompressed_size)
            elif place.compression == "lz4":
                data = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=place.uncompressed_size + 1)
            elif place.compression == "":
                data = packed
            else:
                raise self._bad(f"chunk at byte {place.offset} uses unknown compression {place.compression!r:.40}")
        except (zstandard.ZstdError, RuntimeError, EOFError) as error:
            raise self._bad(f"chunk at byte {place.offset} cannot be unpacked: {error}") from None
        if len(data) != place.uncompressed_size:
            raise self._bad(f"chunk at byte {place.offset} holds {len(data)} bytes, claims {place.uncompressed_size}")
        if place.checksum and zlib.crc32(data) != place.checksum:
            raise self._bad(f"checksum of the chunk at byte {place.offset} is wrong: the file is damaged")
        return data

    def _records(self, data: bytes, chunk: int) -> Iterator[tuple[int, int, int]]:
        """Yield (opcode, start of body, length) of the records in a chunk."""
        offset = 0
        while offset < len(data):
            if offset + _RECORD.size > len(data):
                raise self._bad(f"chunk at byte {self._chunks[chunk].offset} ends within a record")
            opcode, length = _RECORD.unpack_from(data, offset)
            offset += _RECORD.size
            if offset + length > len(data):
                raise self._bad(f"chunk at byte {self._chunks[chunk].offset} ends within a record")
            yield opcode, offset, length
            offset += length

    def _message(
        self, data: bytes, start: int, length: int, location: Location, wanted: set[int] | None
    ) -> LogMessage | None:
        if length < _MESSAGE.size:
            raise self._bad("a message is shorter than its header")
        channel_id, _, log_time, _ = _MESSAGE.unpack_from(data, start)
        if wanted is not None and channel_id not in wanted:
            return None
        channel = self.channels.get(channel_id)
        if channel is None:
            raise self._bad(f"a message belongs to channel {channel_id}, which the file does not define")
        return LogMessage(channel, log_time, data[start + _MESSAGE.size : start + length], location)

    def _loose_body(self, body: int) -> bytes:
        self._file.seek(body - _RECORD.size)
        _, length = _RECORD.unpack(self._file.read(_RECORD.size))
        return self._file.read(length)

    def _parse(self, kind: Any, offset: int, length: int) -> Any:
        self._file.seek(offset + _RECORD.size)
        return self._record(kind, self._file.read(length), offset)

    def _record(self, kind: Any, body: bytes, offset: int) -> Any:
        try:
            return kind.read(ReadDataStream(BytesIO(body)))
        except (McapError, struct.error, UnicodeDecodeError, ValueError) as error:
            raise self._bad(f"{kind.__name__} record at byte {offset} is damaged ({error})") from None

    def _torn(self, offset: int) -> BadInput:
        messages = sum(len(entries) for entries in self.message_index.values()) + len(self._loose)
        return self._bad(
            f"ends within the record at byte {offset} of {self._size}: "
            f"{len(self._chunks)} whole chunks with {messages} indexed messages were found before it"
        )

    def _bad(self, what: str) -> BadInput:
        return BadInput(f"{self.path}: {what}", hint=HINT)

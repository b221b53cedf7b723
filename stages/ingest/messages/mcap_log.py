"""MCAP files: structure checked when opened, checksums when read, memory flat.

The reader of the mcap package neither checks checksums by default nor says where a torn file ends, and it loads a
file without an index whole. This one refuses a damaged file before work starts; or, where a log is all there is, it
gives what the whole chunks of a damaged file hold and says what was lost. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import heapq
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.messages.damage_lines import HINT, DamageLines
from scenewright.stages.ingest.messages.log_file import Damaged, LogFile
from scenewright.stages.ingest.messages.mcap_records import (
    HEAD,
    MAGIC,
    MESSAGE_HEAD,
    read_channel,
    read_chunk_head,
    read_schema,
)
from scenewright.stages.ingest.messages.mcap_structure import McapStructure
from scenewright.stages.kit.formats.bounded_unpacking import unpacked
from scenewright.stages.kit.formats.chunk_cache import ChunkCache

LARGEST_CHUNK = 1 << 30
"""Unpacked bytes of one chunk, or of one message outside of chunks, that are accepted; more is taken for a bomb."""


@dataclass(frozen=True, slots=True)
class Location:
    """Where a message stands: `chunk` is an index into the chunks, or -1 for a message outside of chunks."""

    chunk: int
    offset: int


@dataclass(frozen=True, slots=True)
class LogMessage:
    """One message: its channel, log time [ns], payload and where it stands."""

    channel: Channel
    log_time: int
    data: bytes
    location: Location


class McapLog:
    """An MCAP file, open for reading. One chunk is unpacked at a time by `messages`, a few are kept by `fetch`.

    Raises BadInput for anything that is torn or lies; with `salvage`, only when the file is no MCAP file at all: what
    cannot be read is skipped and stands in `damage`, which is complete after `messages` was read to its end.
    """

    def __init__(self, path: Path, *, salvage: bool = False) -> None:
        self.path = Path(path)
        self.damage = DamageLines(self.path, salvage=salvage)
        self.message_counts: dict[int, int] | None = None
        """Channel id -> messages, where the file states them or had to be read for its channels."""
        self._counts: Counter[int] = Counter()
        """Channel id -> messages in what was examined."""
        self._examined: set[int] = set()
        """Offsets of chunks that were read to their end."""
        self._loose_examined = 0
        self._cache = ChunkCache()
        self._file = LogFile(self.path, "an MCAP file")
        try:
            self._structure = McapStructure(self._file, self.damage)
            self.profile = self._structure.profile
            self.channels = self._structure.channels
            self.schemas = self._structure.schemas
            self.metadata = self._structure.metadata
            self.unchecked_chunks = self._structure.unchecked_chunks
            self._chunks, self._loose = self._structure.chunks, self._structure.loose
            self._find_counts()
            self._check_schemas()
        except Damaged as fault:
            self._file.close()
            raise self._bad(str(fault)) from None
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
        """Yield messages of the channels (all of them: None) in file order."""
        wanted_ids = None if channel_ids is None else set(channel_ids)
        chunks = sorted((offset, index) for index, offset in enumerate(self._chunks))
        for offset, index in heapq.merge(chunks, ((offset, -1) for offset in self._loose)):
            if index >= 0:
                yield from self._chunk_messages(index, wanted_ids)
            else:
                message = self._loose_message(offset)
                if message is not None and (wanted_ids is None or message.channel.id in wanted_ids):
                    yield message
        stated, counted = self._structure.stated_messages, self._counts.total()
        if stated not in (None, counted) and not self.damage:
            self.damage.found(f"states {stated} messages and holds {counted}")

    def indexed(self, channel_id: int) -> Iterator[tuple[int, Location]]:
        """Yield (log time [ns], where) of a channel's messages, as far as the file has message indexes.

        Raises BadInput when an index cannot be read.
        """
        table = self._structure.indexes
        for _, chunk, offset, number in table[table[:, 0] == channel_id].tolist():
            try:
                entries = np.frombuffer(self._file.exactly(offset, number * 16), "<u8").reshape(-1, 2)
            except Damaged as fault:
                raise self._bad(f"message index at byte {offset} {fault}") from None
            for time, record_offset in entries.tolist():
                yield time, Location(chunk, record_offset + HEAD.size)

    def fetch(self, location: Location) -> LogMessage:
        """Return the message at a location that `messages` or `indexed` gave. Raises BadInput when it is damaged."""
        try:
            if location.chunk < 0:
                body, start = self._loose_body(location.offset - HEAD.size), 0
                length = len(body)
            else:
                body, start = self._cache.get(location.chunk, self._unpack), location.offset
                if start + MESSAGE_HEAD.size > len(body):
                    raise Damaged("holds no message where the message index says")
                opcode, length = HEAD.unpack_from(body, start - HEAD.size)
                if opcode != Opcode.MESSAGE or start + length > len(body):
                    raise Damaged("holds no message where the message index says")
            if length < MESSAGE_HEAD.size:
                raise Damaged("holds a message that is shorter than its header")
        except Damaged as fault:
            subject = f"chunk at byte {self._chunks[location.chunk]}" if location.chunk >= 0 else "message"
            raise self._bad(f"{subject} {fault}") from None
        channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(body, start)
        if channel_id not in self.channels:
            raise self._bad(f"a message belongs to channel {channel_id}, which the file does not define")
        data = body[start + MESSAGE_HEAD.size : start + length]
        return LogMessage(self.channels[channel_id], log_time, data, location)

    @property
    def notes(self) -> list[str]:
        """What cannot be known of the file, for people."""
        lines = []
        if self.unchecked_chunks:
            lines.append(f"{self.unchecked_chunks} of {len(self._chunks)} chunks carry no checksum")
        if self._loose and not self._structure.data_checked:
            lines.append(f"{len(self._loose)} messages outside of chunks carry no checksum")
        lines = [line + ": changed bytes in them cannot be noticed" for line in lines]
        if self._structure.unknown_records:
            lines.append(f"{self._structure.unknown_records} records of unknown kinds were skipped")
        return lines

    # --- what the chunks have to be read for -----------------------------------------------------------------

    def _find_counts(self) -> None:
        """Find the number of messages by channel where that costs nothing, or where chunks must be read anyhow."""
        structure = self._structure
        if not structure.complete:
            self._find_definitions()
        elif structure.stated_messages is not None:
            self.message_counts = structure.stated_counts
        elif len(structure.indexes) and not self._loose:
            counts: Counter[int] = Counter()
            for channel, _, _, number in structure.indexes.tolist():
                counts[channel] += number
            self.message_counts = dict(counts)

    def _find_definitions(self) -> None:
        """Collect schemas and channels from the chunks of a file that does not repeat them in its summary."""
        counts: Counter[int] = Counter()
        for index in range(len(self._chunks)):
            counts_here: Counter[int] = Counter()
            try:
                data = self._unpack(index)
                for opcode, start, length in _records(data):
                    if opcode != Opcode.MESSAGE:
                        self._define(opcode, data[start : start + length])
                    elif length >= MESSAGE_HEAD.size:
                        counts_here[int.from_bytes(data[start : start + 2], "little")] += 1
            except Damaged as fault:
                self._report_lost_chunk(index, fault, counts_here.total())
            counts.update(counts_here)
        for offset in self._loose:
            counts[int.from_bytes(self._file.read(offset + HEAD.size, 2), "little")] += 1
        self.message_counts = dict(counts)

    def _define(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            self._structure.define(read_schema(body))
        elif opcode == Opcode.CHANNEL:
            self._structure.define(read_channel(body))

    def _check_schemas(self) -> None:
        for channel in self.channels.values():
            if channel.schema_id and channel.schema_id not in self.schemas:
                missing = f"schema {channel.schema_id}, which the file does not define"
                self.damage.found(f"channel {channel.topic!r} has {missing}")

    # --- reading ---------------------------------------------------------------------------------------------

    def _chunk_messages(self, index: int, wanted_ids: set[int] | None) -> Iterator[LogMessage]:
        """Yield the wanted messages of a chunk; what is wrong in it is noted when it is read to its end."""
        counts_here: Counter[int] = Counter()
        short = 0
        try:
            data = self._unpack(index)
            for opcode, start, length in _records(data):
                if opcode != Opcode.MESSAGE:
                    self._define(opcode, data[start : start + length])
                    continue
                if length < MESSAGE_HEAD.size:
                    short += 1
                    continue
                channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(data, start)
                counts_here[channel_id] += 1
                channel = self.channels.get(channel_id)
                if channel is not None and (wanted_ids is None or channel_id in wanted_ids):
                    content = data[start + MESSAGE_HEAD.size : start + length]
                    yield LogMessage(channel, log_time, content, Location(index, start))
        except Damaged as fault:
            self._report_lost_chunk(index, fault, counts_here.total())
        else:
            indexed = self._structure.indexed_messages(index)
            if indexed is not None and counts_here.total() < indexed:
                where = f"chunk at byte {self._chunks[index]}"
                self.damage.found(f"{where} holds {counts_here.total()} messages, its index names {indexed}")
        if self._chunks[index] not in self._examined:
            self._examined.add(self._chunks[index])
            self._take_counts(counts_here, short)

    def _loose_message(self, offset: int) -> LogMessage | None:
        counts_here: Counter[int] = Counter()
        short, message = 0, None
        try:
            body = self._loose_body(offset)
            if len(body) < MESSAGE_HEAD.size:
                short = 1
            else:
                channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(body)
                counts_here[channel_id] = 1
                if channel_id in self.channels:
                    location = Location(-1, offset + HEAD.size)
                    message = LogMessage(self.channels[channel_id], log_time, body[MESSAGE_HEAD.size :], location)
        except Damaged as fault:
            self.damage.found(f"message at byte {offset} {fault}: it is lost")
        if offset > self._loose_examined:
            self._loose_examined = offset
            self._take_counts(counts_here, short)
        return message

    def _loose_body(self, offset: int) -> bytes:
        opcode, length = self._structure.head(offset)
        if opcode != Opcode.MESSAGE:
            raise Damaged("is not a message")
        if length > LARGEST_CHUNK:
            raise Damaged(f"has {length} bytes, more than {LARGEST_CHUNK}")
        return self._file.exactly(offset + HEAD.size, length)

    def _take_counts(self, counts_here: Counter[int], short: int) -> None:
        self._counts.update(counts_here)
        for channel_id, number in sorted(counts_here.items()):
            if channel_id not in self.channels:
                self.damage.found(f"a message belongs to channel {channel_id}, which the file does not define", number)
        if short:
            self.damage.found("a message is shorter than its header", short)

    def _unpack(self, index: int) -> bytes:
        """Return what a chunk holds. Raises Damaged."""
        offset = self._chunks[index]
        _, length = self._structure.head(offset)
        head = read_chunk_head(self._file, offset, length)
        claimed = max(head.size, head.packed_size)
        if claimed > LARGEST_CHUNK:
            raise Damaged(f"claims {claimed} bytes, more than {LARGEST_CHUNK}")
        try:
            data = unpacked(self._file.exactly(head.start, head.packed_size), head.compression, head.size)
        except ValueError as error:
            raise Damaged(str(error)) from None
        if head.checksum and zlib.crc32(data) != head.checksum:
            raise Damaged("has a wrong checksum")
        return data

    def _report_lost_chunk(self, index: int, fault: Damaged, messages_read: int) -> None:
        messages = self._structure.indexed_messages(index)
        count = "no index says how many messages" if messages is None else f"{messages} messages by its index"
        consequence = f"all but its first {messages_read} messages are lost" if messages_read else "it is lost"
        self.damage.found(f"chunk at byte {self._chunks[index]} ({count}) {fault}: {consequence}")

    def _bad(self, fault: str) -> BadInput:
        return BadInput(f"{self.path}: {fault}", hint=HINT)


def _records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, start of body, length) of the records in a chunk. Raises Damaged when it ends within one."""
    offset = 0
    while offset < len(data):
        if offset + HEAD.size > len(data):
            raise Damaged("ends within a record")
        opcode, length = HEAD.unpack_from(data, offset)
        offset += HEAD.size
        if offset + length > len(data):
            raise Damaged("ends within a record")
        yield opcode, offset, length
        offset += length


__all__ = ["LARGEST_CHUNK", "MAGIC", "Location", "LogMessage", "McapLog"]

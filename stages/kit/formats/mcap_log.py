"""MCAP files, record by record: structure checked when opened, checksums when read, memory flat.

The reader of the mcap package neither checks checksums by default nor says where a torn file ends, and it loads a
file without an index whole. This one walks the records once (without unpacking chunks), so that a damaged file is
refused before work starts; or, where a log is all there is, it gives what the whole chunks of a damaged file hold and
says what was lost. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import heapq
import zlib
from array import array
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema

from schemas.errors import BadInput
from stages.kit.formats.bounded_unpacking import unpacked
from stages.kit.formats.chunk_cache import ChunkCache
from stages.kit.formats.damage_lines import HINT, DamageLines
from stages.kit.formats.mcap_records import (
    HEAD,
    MAGIC,
    MESSAGE_HEAD,
    ChunkHead,
    Damaged,
    find_chunk,
    find_data_end,
    read_channel,
    read_chunk_head,
    read_chunk_index,
    read_footer,
    read_header,
    read_metadata,
    read_schema,
    read_statistics,
)

LARGEST_CHUNK = 1 << 30
"""Unpacked bytes of one chunk, or of one message outside of chunks, that are accepted; more is taken for a bomb."""
LARGEST_RECORD = 64 << 20
"""Bytes of a schema, channel, metadata or index record that are accepted."""
MOST_DEFINITIONS = 256 << 20
"""Bytes of all schemas, channels and metadata together that are kept."""
_PER_DEFINITION = 500
"""Bytes that a definition costs besides its own."""
_PIECE = 1 << 20
_KNOWN = {int(code) for code in Opcode}


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
        self.salvage = salvage
        self.profile = ""
        """`ros1`, `ros2` or what the header says."""
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.damage = DamageLines(self.path, salvage=salvage)
        self.message_counts: dict[int, int] | None = None
        """Channel id -> messages, where the file states them or had to be read for its channels."""
        self.unchecked_chunks = 0
        """Chunks without a checksum, in a file without one over all its data: flipped bits cannot be noticed there."""
        self._stated_messages: int | None = None
        self._stated_chunks: list[int] = []
        self._found: Counter[int] = Counter()
        """Channel id -> messages in what `_examined` holds."""
        self._chunks = array("Q")
        """Offsets of the chunk records."""
        self._loose = array("Q")
        """Offsets of the message records outside of chunks."""
        self._indexes = np.zeros((0, 4), np.uint64)
        """Of every MessageIndex: channel, chunk, offset of its entries, number of entries."""
        self._examined: set[int] = set()
        """Offsets of chunks that were read to their end."""
        self._loose_examined = 0
        self._definitions_left = MOST_DEFINITIONS
        self._cache = ChunkCache()
        try:
            self._file: BinaryIO = self.path.open("rb")
        except FileNotFoundError:
            raise BadInput(f"{self.path}: file is missing") from None
        except IsADirectoryError:
            raise BadInput(f"{self.path}: is a folder, expected an MCAP file") from None
        except OSError as error:
            raise BadInput(f"{self.path}: cannot be opened: {error.strerror}") from None
        try:
            self._size = self.path.stat().st_size
            self._open()
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
        wanted = None if channel_ids is None else set(channel_ids)
        chunks = ((offset, index) for index, offset in sorted(enumerate(self._chunks), key=lambda pair: pair[1]))
        for offset, index in heapq.merge(chunks, ((offset, -1) for offset in self._loose)):
            if index >= 0:
                yield from self._chunk_messages(index, wanted)
            else:
                message = self._loose_message(offset)
                if message is not None and (wanted is None or message.channel.id in wanted):
                    yield message
        found = sum(self._found.values())
        if self._stated_messages not in (None, found) and not self.damage:
            self.damage.found(f"states {self._stated_messages} messages and holds {found}")

    def indexed(self, channel_id: int) -> Iterator[tuple[int, Location]]:
        """Yield (log time [ns], where) of a channel's messages, as far as the file has message indexes."""
        for _, chunk, offset, number in self._indexes[self._indexes[:, 0] == channel_id].tolist():
            try:
                entries = np.frombuffer(self._read(offset, number * 16), "<u8").reshape(-1, 2)
            except Damaged as fault:
                raise self._bad(f"message index at byte {offset} {fault}") from None
            for time, place in entries.tolist():
                yield time, Location(chunk, place + HEAD.size)

    def fetch(self, location: Location) -> LogMessage:
        """Return the message at a location that `messages` or `indexed` gave. Raises BadInput when it is damaged."""
        try:
            if location.chunk < 0:
                opcode, length = self._head(location.offset - HEAD.size)
                body, start = self._read(location.offset, self._bounded(length, LARGEST_CHUNK)), 0
            else:
                body, start = self._cache.get(location.chunk, self._unpack), location.offset
                if start + MESSAGE_HEAD.size > len(body):
                    raise Damaged("is not where the message index says")
                opcode, length = HEAD.unpack_from(body, start - HEAD.size)
            if opcode != Opcode.MESSAGE or start + length > len(body) or length < MESSAGE_HEAD.size:
                raise Damaged("is not where the message index says")
        except Damaged as fault:
            where = f"chunk at byte {self._chunks[location.chunk]}" if location.chunk >= 0 else "file"
            raise self._bad(f"a message of the {where} cannot be read: {where} {fault}") from None
        channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(body, start)
        if channel_id not in self.channels:
            raise self._bad(f"a message belongs to channel {channel_id}, which the file does not define")
        data = body[start + MESSAGE_HEAD.size : start + length]
        return LogMessage(self.channels[channel_id], log_time, data, location)

    @property
    def notes(self) -> list[str]:
        """What cannot be known of the file, for people."""
        said = []
        if self.unchecked_chunks:
            said.append(f"{self.unchecked_chunks} of {len(self._chunks)} chunks carry no checksum")
        if self._loose and not self._data_checked:
            said.append(f"{len(self._loose)} messages outside of chunks carry no checksum")
        return [line + ": changed bytes in them cannot be noticed" for line in said]

    # --- structure -------------------------------------------------------------------------------------------

    def _open(self) -> None:
        if self._size < len(MAGIC) or self._file.read(len(MAGIC)) != MAGIC:
            raise self._bad("is empty" if self._size == 0 else "is no MCAP file (wrong first bytes)")
        self._data_end: int | None = None
        """Offset behind the DataEnd record."""
        self._data_checksum = 0
        self._data_checked = False
        self._late: list[Schema | Channel] = []
        """Definitions that the summary repeats."""
        self._index_rows = array("Q")
        self._stated_counts: dict[int, int] = {}
        self._stated_channels = 0
        end = self._walk()
        self._indexes = np.array(self._index_rows, np.uint64).reshape(-1, 4)
        if end is not None and self._summary_holds(end):
            for record in self._late:
                self._define(record)
            self._find_stated_chunks()
        else:
            self._late, self._stated_messages, self._stated_channels = [], None, 0
        if not self._late or self._stated_channels > len(self.channels):
            self._find_definitions()
        elif self._stated_messages is not None:
            self.message_counts = self._stated_counts
        elif len(self._indexes) and not self._loose:
            channels, places = np.unique(self._indexes[:, 0], return_inverse=True)
            counts = np.bincount(places, self._indexes[:, 3].astype(float)).astype(int)
            self.message_counts = dict(zip(channels.tolist(), counts.tolist(), strict=True))
        self._check_data_section()
        self._check_schemas()

    def _walk(self) -> Footer | None:
        """Visit every top-level record up to the footer and return that; None where a torn file has none."""
        offset = scan_from = len(MAGIC)
        while True:
            try:
                opcode, length = self._head(offset)
                footer = self._visit(opcode, offset, length)
            except Damaged as fault:
                following = self._skip(offset, scan_from, fault)
                if following is None:
                    return None
                offset = scan_from = following
                continue
            end = offset + HEAD.size + length
            if footer is not None:
                return footer if self._check_closing(end) else None
            scan_from = end if opcode == Opcode.CHUNK else offset + 1
            offset = end

    def _head(self, offset: int) -> tuple[int, int]:
        """Return opcode and length of the top-level record at an offset. Raises Damaged when it is none."""
        if offset >= self._size:
            raise Damaged("ends without a footer: it was not closed, as after a power failure")
        self._file.seek(offset)
        head = self._read_on(min(HEAD.size, self._size - offset))
        if len(head) < HEAD.size:
            raise Damaged("ends within it")
        opcode, length = HEAD.unpack(head)
        if opcode == 0:
            raise Damaged("has no opcode")
        if offset + HEAD.size + length > self._size:
            raise Damaged("ends within it")
        return opcode, length

    def _visit(self, opcode: int, offset: int, length: int) -> Footer | None:
        """Take in one top-level record; its body is read where it is a definition. Raises Damaged."""
        body = offset + HEAD.size
        if offset == len(MAGIC):
            if opcode != Opcode.HEADER:
                raise Damaged("is no header")
            self.profile = read_header(self._definition(offset, length))
        elif opcode == Opcode.CHUNK:
            head = read_chunk_head(self._file, offset, length)
            if head.size:
                self._chunks.append(offset)
                self.unchecked_chunks += head.checksum == 0
        elif opcode == Opcode.MESSAGE:
            self._loose.append(offset)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._note_index(offset, length)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            content = self._definition(offset, length)
            record = read_schema(content) if opcode == Opcode.SCHEMA else read_channel(content)
            if self._data_end is None:
                self._define(record)
            else:
                self._late.append(record)
        elif opcode == Opcode.METADATA:
            self.metadata.append(read_metadata(self._definition(offset, length)))
        elif opcode == Opcode.ATTACHMENT:
            self._check_attachment(offset, length)
        elif opcode == Opcode.DATA_END:
            self._data_checksum = int.from_bytes(self._read(body, self._bounded(length, 4)), "little")
            self._data_end = body + length
        elif opcode == Opcode.STATISTICS:
            self._stated_messages, self._stated_channels, self._stated_counts = read_statistics(
                self._definition(offset, length)
            )
        elif opcode == Opcode.CHUNK_INDEX:
            self._stated_chunks.append(read_chunk_index(self._read(body, self._bounded(length, LARGEST_RECORD))))
        elif opcode == Opcode.FOOTER:
            if self._data_end is None and not self.damage:
                raise Damaged("is a footer without an end of data before it")
            return read_footer(self._read(body, self._bounded(length, LARGEST_RECORD)))
        return None

    def _note_index(self, offset: int, length: int) -> None:
        channel = int.from_bytes(self._read(offset + HEAD.size, 2), "little")
        entries = int.from_bytes(self._read_on(4), "little")
        if entries % 16 or 6 + entries != self._bounded(length, LARGEST_RECORD):
            raise Damaged(f"is a message index of {length} bytes that claims {entries} bytes of entries")
        if self._data_end is None and self._chunks and entries:
            self._index_rows.extend((channel, len(self._chunks) - 1, offset + HEAD.size + 6, entries // 16))

    def _check_attachment(self, offset: int, length: int) -> None:
        """Attachments are not read; a wrong checksum of one that is not long is damage all the same."""
        if 4 < length <= LARGEST_RECORD:
            stated = int.from_bytes(self._read(offset + HEAD.size + length - 4, 4), "little")
            if stated and self._checksum(offset + HEAD.size, offset + HEAD.size + length - 4) != stated:
                self.damage.found(f"checksum of the attachment at byte {offset} is wrong (attachments are not used)")

    def _skip(self, offset: int, scan_from: int, fault: Damaged) -> int | None:
        """Return where reading goes on after a damaged record, and note what is lost; None: nothing follows."""
        if not self.salvage:
            raise self._bad(self._torn(offset, fault))
        following = self._own_end(offset)
        if following is None:
            found = find_chunk(self._file, scan_from, self._size)
            ends = find_data_end(self._file, self._size) if self._data_end is None else None
            candidates = [place for place in (found, ends) if place is not None and place >= scan_from]
            following = min(candidates, default=None)
        if offset >= self._size:
            self.damage.note(str(fault))
            return None
        lost = (self._size if following is None else following) - offset
        what = (
            f"record at byte {offset} {fault}"
            if str(fault) != "ends within it"
            else f"ends within the record at byte {offset}"
        )
        if self._data_end is not None:
            self.damage.note(f"{what}: the summary is damaged, no message is lost")
        elif following is None:
            self.damage.note(f"{what}: the last {lost} bytes are lost, and what was not written")
        else:
            self.damage.note(f"{what}: {max(lost, 0)} bytes are lost; reading goes on at byte {following}")
        return following

    def _own_end(self, offset: int) -> int | None:
        """Return the end that a damaged record claims when another record begins there."""
        try:
            _, length = self._head(offset)
            end = offset + HEAD.size + length
            opcode, _ = self._head(end)
        except Damaged:
            return None
        return end if opcode in _KNOWN else None

    def _check_closing(self, end: int) -> bool:
        self._file.seek(end)
        rest = self._read_on(len(MAGIC) + 1)
        if rest != MAGIC:
            what = "more bytes" if rest.startswith(MAGIC) else "no closing magic"
            self.damage.found(f"has {what} after the footer, at byte {end}: no message is lost")
        return rest.startswith(MAGIC)

    def _summary_holds(self, footer: Footer) -> bool:
        """Whether the summary can be relied on: its checksum is right, or there is none."""
        start = footer.summary_start or footer.summary_offset_start
        end = self._size - len(MAGIC) - 4
        if not footer.summary_crc or not start:
            return True
        if not 0 < start <= end:
            self.damage.found(f"summary starts at byte {start} of {self._size}")
            return False
        if self._checksum(start, end) != footer.summary_crc:
            self.damage.found("checksum of the summary is wrong: the summary is damaged, no message is lost")
            return False
        return True

    def _find_stated_chunks(self) -> None:
        """A chunk that the summary names and the walk did not meet lies behind a damaged length."""
        met = set(self._chunks)
        for offset in self._stated_chunks:
            if offset in met:
                continue
            try:
                opcode, length = self._head(offset)
                if opcode != Opcode.CHUNK:
                    raise Damaged("is no chunk")
                if read_chunk_head(self._file, offset, length).size:
                    self._chunks.append(offset)
                    self.damage.found(f"a record before the chunk at byte {offset} lies about its length")
            except Damaged as fault:
                if not any(f"byte {offset} " in line for line in self.damage):
                    self.damage.found(f"chunk at byte {offset}, which the summary names, {fault}: it is lost")

    def _check_data_section(self) -> None:
        if self._data_end is None or not self._data_checksum or self.damage:
            return
        self._data_checked = self._checksum(0, self._data_end - HEAD.size - 4) == self._data_checksum
        if self._data_checked:
            self.unchecked_chunks = 0
        else:
            self.damage.found("checksum of the data section is wrong: something in it has changed")

    def _check_schemas(self) -> None:
        for channel in self.channels.values():
            if channel.schema_id and channel.schema_id not in self.schemas:
                self.damage.found(
                    f"channel {channel.topic!r} has schema {channel.schema_id}, which the file does not define"
                )

    def _find_definitions(self) -> None:
        """Collect schemas and channels from the chunks of a file that does not repeat them in its summary."""
        counts: Counter[int] = Counter()
        for index in range(len(self._chunks)):
            try:
                data = self._unpack(index)
                for opcode, start, length in _records(data):
                    if opcode == Opcode.SCHEMA:
                        self._define(read_schema(data[start : start + length]))
                    elif opcode == Opcode.CHANNEL:
                        self._define(read_channel(data[start : start + length]))
                    elif opcode == Opcode.MESSAGE:
                        counts[int.from_bytes(data[start : start + 2], "little")] += 1
            except Damaged as fault:
                self._chunk_trouble(index, fault)
        for offset in self._loose:
            counts[int.from_bytes(self._read(offset + HEAD.size, 2), "little")] += 1
        self.message_counts = dict(counts)

    def _define(self, record: Schema | Channel) -> None:
        """Take in a definition; one that contradicts an earlier one is damage, and the earlier one stays."""
        table: dict[int, Any] = self.schemas if isinstance(record, Schema) else self.channels
        known = table.setdefault(record.id, record)
        if isinstance(record, Schema):
            same = (known.name, known.encoding, known.data) == (record.name, record.encoding, record.data)
            names = f"schema {record.id} is defined twice, as {known.name!r} and as {record.name!r}"
        else:
            same = (known.topic, known.message_encoding, known.schema_id) == (
                record.topic,
                record.message_encoding,
                record.schema_id,
            )
            names = f"channel {record.id} is defined twice, as {known.topic!r} and as {record.topic!r}"
        if not same:
            self.damage.found(f"{names}: the first is used")

    # --- reading ---------------------------------------------------------------------------------------------

    def _chunk_messages(self, index: int, wanted: set[int] | None) -> Iterator[LogMessage]:
        """Yield the wanted messages of a chunk; what is wrong in it is noted when it is read to its end."""
        found: Counter[int] = Counter()
        short = 0
        try:
            data = self._unpack(index)
            for opcode, start, length in _records(data):
                if opcode == Opcode.MESSAGE:
                    if length < MESSAGE_HEAD.size:
                        short += 1
                        continue
                    channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(data, start)
                    found[channel_id] += 1
                    channel = self.channels.get(channel_id)
                    if channel is not None and (wanted is None or channel_id in wanted):
                        content = data[start + MESSAGE_HEAD.size : start + length]
                        yield LogMessage(channel, log_time, content, Location(index, start))
                elif opcode == Opcode.SCHEMA:
                    self._define(read_schema(data[start : start + length]))
                elif opcode == Opcode.CHANNEL:
                    self._define(read_channel(data[start : start + length]))
        except Damaged as fault:
            self._chunk_trouble(index, fault)
        if self._chunks[index] not in self._examined:
            self._examined.add(self._chunks[index])
            self._take_counts(found, short)

    def _loose_message(self, offset: int) -> LogMessage | None:
        first, found, short, message = offset > self._loose_examined, Counter[int](), 0, None
        try:
            _, length = self._head(offset)
            body = self._read(offset + HEAD.size, self._bounded(length, LARGEST_CHUNK))
            if length < MESSAGE_HEAD.size:
                short = 1
            else:
                channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(body)
                found[channel_id] = 1
                if channel_id in self.channels:
                    place = Location(-1, offset + HEAD.size)
                    message = LogMessage(self.channels[channel_id], log_time, body[MESSAGE_HEAD.size :], place)
        except Damaged as fault:
            self.damage.found(f"message at byte {offset} {fault}: it is lost")
        if first:
            self._loose_examined = offset
            self._take_counts(found, short)
        return message

    def _take_counts(self, found: Counter[int], short: int) -> None:
        self._found.update(found)
        for channel_id, number in sorted(found.items()):
            if channel_id not in self.channels:
                self.damage.found(f"a message belongs to channel {channel_id}, which the file does not define", number)
        if short:
            self.damage.found("a message is shorter than its header", short)

    def _chunk_head(self, index: int) -> ChunkHead:
        offset = self._chunks[index]
        _, length = self._head(offset)
        return read_chunk_head(self._file, offset, length)

    def _unpack(self, index: int) -> bytes:
        head = self._chunk_head(index)
        if head.size > LARGEST_CHUNK or head.packed_size > 2 * LARGEST_CHUNK:
            raise Damaged(f"claims {max(head.size, head.packed_size)} bytes, more than {LARGEST_CHUNK}")
        try:
            data = unpacked(self._read(head.start, head.packed_size), head.compression, head.size)
        except ValueError as error:
            raise Damaged(str(error)) from None
        if head.checksum and zlib.crc32(data) != head.checksum:
            raise Damaged("has a wrong checksum")
        return data

    def _definition(self, offset: int, length: int) -> bytes:
        """Return the body of a definition, as long as all of them together stay small."""
        self._bounded(length, min(LARGEST_RECORD, self._definitions_left))
        self._definitions_left -= length + _PER_DEFINITION
        return self._read(offset + HEAD.size, length)

    @staticmethod
    def _bounded(length: int, limit: int) -> int:
        if length > limit:
            raise Damaged(f"has {length} bytes, more than the {max(limit, 0)} that are accepted")
        return length

    def _read(self, offset: int, length: int) -> bytes:
        self._file.seek(offset)
        data = self._read_on(length)
        if len(data) != length:
            raise Damaged(f"ends {length - len(data)} bytes early")
        return data

    def _read_on(self, length: int) -> bytes:
        try:
            return self._file.read(length)
        except OSError as error:
            raise Damaged(f"cannot be read from the disk ({error.strerror})") from None

    def _checksum(self, start: int, end: int) -> int:
        """CRC-32 of the bytes from start to end, read piece by piece."""
        checksum = 0
        for place in range(start, end, _PIECE):
            checksum = zlib.crc32(self._read(place, min(_PIECE, end - place)), checksum)
        return checksum

    # --- damage ----------------------------------------------------------------------------------------------

    def _torn(self, offset: int, fault: Damaged) -> str:
        what = (
            f"ends within the record at byte {offset}"
            if str(fault) == "ends within it"
            else f"record at byte {offset} {fault}"
        )
        messages = sum(self._index_rows[3::4]) + len(self._loose)
        return (
            f"{what} of {self._size}: {len(self._chunks)} whole chunks with {messages} indexed messages "
            "were found before it"
        )

    def _chunk_trouble(self, index: int, fault: Damaged) -> None:
        offset = self._chunks[index]
        messages = int(self._indexes[self._indexes[:, 1] == index, 3].sum())
        count = f"{messages} messages by its index" if messages else "no index says how many messages"
        _, length = HEAD.unpack(self._read(offset, HEAD.size))
        self.damage.found(f"chunk at byte {offset} ({length} bytes, {count}) {fault}: it is lost")

    def _bad(self, what: str) -> BadInput:
        return BadInput(f"{self.path}: {what}", hint=HINT)


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

"""What the top-level records of an MCAP file say: one walk that unpacks no chunk.

After a damaged record the walk goes on where that record claims to end when another one begins there, else at the next
thing that can only be a chunk or the end of the data. The summary at the end of a file is believed when its checksum
is right.
"""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.messages.damage_lines import HINT, DamageLines
from scenewright.stages.ingest.messages.log_file import Damaged, LogFile
from scenewright.stages.ingest.messages.mcap_records import (
    COMPRESSIONS,
    DATA_END_SIZE,
    HEAD,
    MAGIC,
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

LARGEST_RECORD = 64 << 20
"""Bytes of a schema, channel, metadata or index record that are accepted."""
MOST_DEFINITIONS = 256 << 20
"""Bytes of all schemas, channels and metadata together that are kept."""
_PER_DEFINITION = 500
"""Bytes that a definition costs besides its own."""
_INDEX_HEAD = 6
"""Bytes of a message index before its entries: channel and length (MCAP specification)."""
_INDEX_ENTRY = 16
"""Bytes of an entry of a message index: time and offset (MCAP specification)."""
_KNOWN = {int(code) for code in Opcode}
_PARSED = {Opcode.MESSAGE, Opcode.MESSAGE_INDEX, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.ATTACHMENT}
"""Opcodes whose records prove in another way that they are what they say, or are too many to look at twice."""
_SUMMARY_ONLY = {
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.STATISTICS,
    Opcode.METADATA_INDEX,
    Opcode.SUMMARY_OFFSET,
}
_CUT = "ends within it"
_UNFINISHED = "ends without a footer: it was not closed, as after a power failure"


class McapStructure:
    """The records of a file. Raises BadInput when it is no MCAP file, or `damage` refuses what is wrong with it."""

    def __init__(self, file: LogFile, damage: DamageLines) -> None:
        self.damage = damage
        self.profile = ""
        """`ros1`, `ros2` or what the header says."""
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.chunks = array("Q")
        """Offsets of the chunk records."""
        self.loose = array("Q")
        """Offsets of the message records outside of chunks."""
        self.unchecked_chunks = 0
        """Chunks without a checksum, in a file without one over all its data."""
        self.unknown_records = 0
        """Records of kinds that the format leaves to others."""
        self.data_checked = False
        """Whether the checksum over all data is there and right."""
        self.stated_messages: int | None = None
        """As the statistics say."""
        self.stated_counts: dict[int, int] = {}
        """Channel -> messages, as the statistics say."""
        self._stated_channels = 0
        self._stated_chunks = array("Q")
        self._file = file
        self._definitions_left = MOST_DEFINITIONS
        self._data_end: int | None = None
        """Offset behind the DataEnd record."""
        self._data_checksum = 0
        self._late: list[Schema | Channel] = []
        """Definitions that the summary repeats."""
        self._misplaced = False
        """Whether a record of the summary stands before the end of data."""
        self._doubted: list[Schema | Channel] = []
        """Definitions outside of chunks after the first damage."""
        self._index_rows = array("Q")
        self._indexed_chunk = -1
        """Chunk that MessageIndex records belong to at this place of the walk; -1 after a damaged one."""
        self._orphans = 0
        """Messages that indexes of damaged chunks name."""
        magic = file.read(0, len(MAGIC))
        if magic != MAGIC:
            fault = "is empty" if not magic else "is not an MCAP file (wrong first bytes)"
            raise BadInput(f"{damage.path}: {fault}", hint=HINT)
        footer = self._walk()
        self.indexes = np.array(self._index_rows, np.uint64).reshape(-1, 4)
        """Of every MessageIndex: channel, chunk, offset of its entries, number of entries."""
        self._take_summary(footer)
        self._indexed = np.zeros(len(self.chunks), np.int64)
        np.add.at(self._indexed, self.indexes[:, 1].astype(np.int64), self.indexes[:, 3].astype(np.int64))
        self._check_data_section()

    @property
    def complete(self) -> bool:
        """Whether all channels of the messages are known without reading the chunks."""
        all_defined = np.isin(self.indexes[:, 0], list(self.channels)).all() if self.channels else not len(self.indexes)
        return bool(self._late) and self._stated_channels <= len(self.channels) and bool(all_defined)

    def head(self, offset: int) -> tuple[int, int]:
        """Return opcode and length of the top-level record at an offset. Raises Damaged when there is none."""
        head = self._file.read(offset, HEAD.size)
        if not head:
            raise Damaged(_UNFINISHED)
        if len(head) < HEAD.size:
            raise Damaged(_CUT)
        opcode, length = HEAD.unpack(head)
        if opcode == 0:
            raise Damaged("has no opcode")
        if offset + HEAD.size + length > self._file.size:
            raise Damaged(_CUT)
        return opcode, length

    def define(self, record: Schema | Channel) -> None:
        """Take in a definition; one that contradicts an earlier one is damage, and the earlier one stays."""
        table: dict[int, Any] = self.schemas if isinstance(record, Schema) else self.channels
        first_record = table.setdefault(record.id, record)
        if _meaning(first_record) != _meaning(record):
            kind, name, second_name = type(record).__name__.lower(), _meaning(first_record)[0], _meaning(record)[0]
            self.damage.found(
                f"{kind} {record.id} is defined twice, as {name!r} and as {second_name!r}: the first is used"
            )

    def indexed_messages(self, chunk: int) -> int | None:
        """Return how many messages a chunk holds by its index; None when it has none."""
        return int(self._indexed[chunk]) if self._indexed[chunk] > 0 else None

    # --- the walk --------------------------------------------------------------------------------------------

    def _walk(self) -> Footer | None:
        """Visit every top-level record up to the footer and return that; None where a torn file has none."""
        offset = scan_from = len(MAGIC)
        footer = None
        while footer is None:
            try:
                opcode, length = self.head(offset)
                footer = self._visit(opcode, offset, length)
            except Damaged as fault:
                following = self._skip(offset, scan_from, fault)
                if following is None:
                    break
                offset = scan_from = following
                continue
            end = offset + HEAD.size + length
            scan_from = end if opcode == Opcode.CHUNK else offset + 1  # only a chunk proves its own length
            offset = end
        if self._orphans:
            self.damage.found(f"message indexes behind damaged places name {self._orphans} messages")
        self._settle_doubts()
        return footer if footer is not None and self._is_closed(offset) else None

    def _settle_doubts(self) -> None:
        """What stands outside of chunks in a damaged file that has chunks may be the inside of a damaged one."""
        if not self.chunks:
            for record in self._doubted:
                self.define(record)
        elif self.damage and self.loose:
            self.damage.found(f"{len(self.loose)} messages outside of chunks are not believed: they are lost")
            del self.loose[:]

    def _visit(self, opcode: int, offset: int, length: int) -> Footer | None:
        """Take in one top-level record; its body is read where it is a definition. Raises Damaged."""
        if opcode in _SUMMARY_ONLY and self._data_end is None and not self._misplaced:
            self._misplaced = True
            self.damage.found(f"record at byte {offset} with opcode {opcode} stands before the end of data")
        if offset == len(MAGIC):
            if opcode != Opcode.HEADER:
                raise Damaged("is not a header")
            self.profile = read_header(self._definition(offset, length))
        elif opcode == Opcode.CHUNK:
            self._visit_chunk(offset, length)
        elif opcode not in _PARSED and self._is_like_chunk(offset, length):
            self.damage.found(f"record at byte {offset} has the opcode {opcode} and is built like a chunk: read as one")
            self._visit_chunk(offset, length)
        elif opcode == Opcode.MESSAGE:
            self._visit_message(offset, length)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._visit_index(offset, length)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            body = self._definition(offset, length)
            record = read_schema(body) if opcode == Opcode.SCHEMA else read_channel(body)
            if self._data_end is not None:
                self._late.append(record)
            elif self.damage:
                self._doubted.append(record)
            else:
                self.define(record)
        elif opcode == Opcode.METADATA:
            self.metadata.append(read_metadata(self._definition(offset, length)))
        elif opcode == Opcode.ATTACHMENT:
            self._visit_attachment(offset, length)
        elif opcode == Opcode.DATA_END:
            if length != DATA_END_SIZE:
                raise Damaged(f"is an end of data of {length} bytes")
            self._data_checksum = int.from_bytes(self._body(offset, length), "little")
            self._data_end = offset + HEAD.size + length
        elif opcode == Opcode.STATISTICS:
            statistics = read_statistics(self._body(offset, length))
            self.stated_messages, self._stated_channels, self.stated_counts = statistics
        elif opcode == Opcode.CHUNK_INDEX:
            self._stated_chunks.append(read_chunk_index(self._body(offset, length)))
        elif opcode == Opcode.FOOTER:
            return self._visit_footer(offset, length)
        elif opcode not in _KNOWN:
            self.unknown_records += 1
            self._indexed_chunk = -1  # may be a chunk with a changed opcode
        return None

    def _visit_chunk(self, offset: int, length: int) -> None:
        head = read_chunk_head(self._file, offset, length)
        self.chunks.append(offset)
        self.unchecked_chunks += head.checksum == 0 and head.size > 0
        self._indexed_chunk = len(self.chunks) - 1

    def _is_like_chunk(self, offset: int, length: int) -> bool:
        try:
            return read_chunk_head(self._file, offset, length).compression in COMPRESSIONS
        except Damaged:
            return False

    def _visit_footer(self, offset: int, length: int) -> Footer:
        closing = self._file.read(offset + HEAD.size + length, len(MAGIC))
        if not MAGIC.startswith(closing):
            raise Damaged("is a footer with something else than the end of the file behind it")
        if self._data_end is None and not self.damage:
            raise Damaged("is a footer without an end of data before it")
        return read_footer(self._body(offset, length))

    def _visit_message(self, offset: int, length: int) -> None:
        if self._data_end is not None:
            raise Damaged("is a message after the end of data")
        if self._indexed_chunk >= 0:  # one bit makes a message of the message index behind a chunk
            head = self._file.exactly(offset + HEAD.size, min(length, _INDEX_HEAD))
            if int.from_bytes(head[2:], "little") == length - _INDEX_HEAD:
                raise Damaged("is a message that is built like a message index")
        self.loose.append(offset)

    def _visit_index(self, offset: int, length: int) -> None:
        head = self._file.exactly(offset + HEAD.size, min(length, _INDEX_HEAD))
        entries = int.from_bytes(head[2:], "little")
        if len(head) < _INDEX_HEAD or entries % _INDEX_ENTRY or entries != _check_length(length) - _INDEX_HEAD:
            raise Damaged(f"is a message index of {length} bytes that claims {entries} bytes of entries")
        if self._data_end is not None:
            return
        number = entries // _INDEX_ENTRY
        if self._indexed_chunk < 0:
            self._orphans += number
        elif number:
            channel = int.from_bytes(head[:2], "little")
            self._index_rows.extend((channel, self._indexed_chunk, offset + HEAD.size + _INDEX_HEAD, number))

    def _visit_attachment(self, offset: int, length: int) -> None:
        """Attachments are not read; a wrong checksum of one that is not long is damage all the same."""
        end = offset + HEAD.size + length - 4
        if 4 < length <= LARGEST_RECORD:
            stated = int.from_bytes(self._file.exactly(end, 4), "little")
            if stated and self._file.checksum(offset + HEAD.size, end) != stated:
                self.damage.found(f"checksum of the attachment at byte {offset} is wrong (attachments are not used)")

    def _definition(self, offset: int, length: int) -> bytes:
        """Return the body of a record that is kept, as long as all of them together stay small."""
        self._definitions_left -= length + _PER_DEFINITION
        if self._definitions_left < 0:
            raise Damaged(f"is more than the {MOST_DEFINITIONS} bytes of definitions that are accepted")
        return self._body(offset, length)

    def _body(self, offset: int, length: int) -> bytes:
        return self._file.exactly(offset + HEAD.size, _check_length(length))

    # --- after a damaged record ------------------------------------------------------------------------------

    def _skip(self, offset: int, scan_from: int, fault: Damaged) -> int | None:
        """Return where reading goes on after a damaged record, and note what is lost; None: nothing follows."""
        self._indexed_chunk = -1
        size, reason = self._file.size, str(fault)
        subject = f"ends within the record at byte {offset}" if reason == _CUT else f"record at byte {offset} {fault}"
        if not self.damage.salvage:
            messages = sum(self._index_rows[3::4]) + len(self.loose)
            before = f"{len(self.chunks)} whole chunks with {messages} indexed messages were found before it"
            self.damage.found(f"{reason if offset >= size else subject}, of {size} bytes: {before}")
        if offset >= size:
            lost = "no message is lost" if self._data_end is not None else "what was not written is lost"
            self.damage.note(f"{_UNFINISHED}; {lost}")
            return None
        following = self._following(offset, scan_from)
        if self._data_end is not None:
            self.damage.note(f"{subject}: the summary is damaged, no message is lost")
        elif following is None:
            self.damage.note(f"{subject}: the last {size - offset} bytes are lost, and what was not written")
        else:
            lost_bytes = max(following - offset, 0)
            self.damage.note(f"{subject}: {lost_bytes} bytes are lost; reading goes on at byte {following}")
        return following

    def _following(self, offset: int, scan_from: int) -> int | None:
        end = self._own_end(offset)
        if end is not None:
            return end
        scan_from += scan_from == offset  # what is damaged cannot be where reading goes on
        places = [find_chunk(self._file, scan_from)]
        if self._data_end is None:
            places.append(find_data_end(self._file))
        return min(
            (candidate for candidate in places if candidate is not None and candidate >= scan_from), default=None
        )

    def _own_end(self, offset: int) -> int | None:
        """Return the end that a damaged record claims when another record begins there."""
        try:
            _, length = self.head(offset)
            end = offset + HEAD.size + length
            opcode, _ = self.head(end)
        except Damaged:
            return None
        return end if opcode in _KNOWN else None

    # --- the end of the file ---------------------------------------------------------------------------------

    def _is_closed(self, end: int) -> bool:
        closing = self._file.read(end, len(MAGIC) + 1)
        if closing != MAGIC:
            fault = "more bytes" if closing.startswith(MAGIC) else "no closing magic"
            self.damage.found(f"has {fault} after the footer, at byte {end}: no message is lost")
        return closing.startswith(MAGIC)

    def _take_summary(self, footer: Footer | None) -> None:
        if footer is None or not self._summary_holds(footer):
            self._late, self.stated_messages, self.stated_counts, self._stated_channels = [], None, {}, 0
            return
        for record in self._late:
            self.define(record)
        met = set(self.chunks)
        for offset in self._stated_chunks:
            if offset not in met:
                self._take_stated_chunk(offset)

    def _summary_holds(self, footer: Footer) -> bool:
        """Whether the summary can be believed: its checksum is right, or there is none."""
        start = footer.summary_start or footer.summary_offset_start
        end = self._file.size - len(MAGIC) - 4
        if not footer.summary_crc or not start:
            return True
        if not 0 < start <= end or self._file.checksum(start, end) != footer.summary_crc:
            self.damage.found("checksum of the summary is wrong: the summary is damaged, no message is lost")
            return False
        return True

    def _take_stated_chunk(self, offset: int) -> None:
        """A chunk that the summary names and the walk did not meet lies behind a damaged length, or is damaged."""
        try:
            opcode, length = self.head(offset)
            if opcode != Opcode.CHUNK:
                raise Damaged("is not a chunk")
            self._visit_chunk(offset, length)
            self.damage.found(f"a record before the chunk at byte {offset} lies about its length")
        except Damaged as fault:
            self.damage.found(f"chunk at byte {offset}, which the summary names, {fault}: it is lost")

    def _check_data_section(self) -> None:
        if self._data_end is None or not self._data_checksum or self.damage:
            return
        try:
            checksum = self._file.checksum(0, self._data_end - HEAD.size - DATA_END_SIZE)
        except Damaged as fault:
            self.damage.found(f"data section {fault}")
            return
        self.data_checked = checksum == self._data_checksum
        if self.data_checked:
            self.unchecked_chunks = 0
        else:
            self.damage.found("checksum of the data section is wrong: something in it has changed")


def _check_length(length: int) -> int:
    if length > LARGEST_RECORD:
        raise Damaged(f"has {length} bytes, more than the {LARGEST_RECORD} that are accepted")
    return length


def _meaning(record: Schema | Channel) -> tuple[Any, ...]:
    """What must be the same in every definition with the same number; the name comes first."""
    if isinstance(record, Schema):
        return record.name, record.encoding, record.data
    return record.topic, record.message_encoding, record.schema_id

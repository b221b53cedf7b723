"""Records of ROS 1 bags, version 2.0: parsed within their bounds, and found again after a damaged place.

A record is the length of its header, the header (fields `length name=value`), the length of its data, the data. Source
of the layout: https://wiki.ros.org/Bags/Format/2.0
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

from scenewright.stages.ingest.messages.log_file import Damaged, LogFile

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 0x02, 0x03, 0x04, 0x05, 0x06, 0x07
"""Values of `op` in a record's header (ROS bag format 2.0)."""
COMPRESSIONS = (b"none", b"bz2", b"lz4")
LARGEST_HEADER = 1 << 20
"""Most bytes of a record's header; a bound against damaged files."""
_USUAL_HEADER = 256
"""Bytes that are read first of a record's header: most are no longer."""
_LENGTH = struct.Struct("<I")
_WINDOW = 4 << 20
"""Bytes that are searched at a time for a chunk; by eye."""
_CHUNK_START = re.compile(rb"[\x10-\x80]\0{3}[\x04-\x40]\0{3}(?:op=\x05|size=|compression=)", re.DOTALL)
_LONGEST_HEADER = 0x80
"""Longest header of a chunk that is searched for [bytes]; by eye."""
_MARK = b"op=" + bytes([CHUNK])


@dataclass(frozen=True, slots=True)
class Record:
    """One record, its data not read yet."""

    op: int
    fields: dict[bytes, bytes]
    start: int
    """Offset of the data."""
    length: int
    """Bytes of the data."""

    @property
    def end(self) -> int:
        """Offset of what follows."""
        return self.start + self.length

    def number(self, name: bytes, size: int = 4) -> int:
        """Return a field as an unsigned number of `size` bytes. Raises Damaged when it is missing or has another."""
        value = self.fields.get(name)
        if value is None or len(value) != size:
            raise Damaged(f"has no field {name.decode()!r} of {size} bytes")
        return int.from_bytes(value, "little")

    def time(self, name: bytes) -> int:
        """Return a field that holds seconds and nanoseconds [ns]. Raises Damaged."""
        packed = self.number(name, 8)
        return (packed & 0xFFFFFFFF) * 1_000_000_000 + (packed >> 32)


def read_fields(header: bytes) -> dict[bytes, bytes]:
    """Return the fields of a header. Raises Damaged when they do not fill it exactly."""
    fields, position = {}, 0
    while position < len(header):
        if position + 4 > len(header):
            raise Damaged("has a header that ends within a field")
        (length,) = _LENGTH.unpack_from(header, position)
        position += 4 + length
        if position > len(header):
            raise Damaged("has a header that ends within a field")
        name, mark, value = header[position - length : position].partition(b"=")
        if not mark:
            raise Damaged("has a header field without a value")
        fields[name] = value
    return fields


def read_record(file: LogFile, offset: int) -> Record:
    """Return the record at `offset` of a file. Raises Damaged when it is none, or is cut."""
    head = file.read(offset, _USUAL_HEADER)
    length = _LENGTH.unpack_from(head)[0] if len(head) >= 4 else 0
    start = offset + 4 + length + 4
    if len(head) < 4 or start > file.size:
        raise Damaged("ends within it")
    if length > LARGEST_HEADER:
        raise Damaged(f"has a header of {length} bytes")
    if len(head) < start - offset:
        head = file.exactly(offset, start - offset)
    fields = read_fields(head[4 : 4 + length])
    record = Record(_op(fields), fields, start, _LENGTH.unpack_from(head, 4 + length)[0])
    if record.end > file.size:
        raise Damaged("ends within it")
    return record


def record_within(data: bytes, offset: int) -> Record:
    """Return the record at `offset` of an unpacked chunk. Raises Damaged when it is none, or is cut."""
    if offset + 4 > len(data):
        raise Damaged("ends within a record")
    start = offset + 4 + _LENGTH.unpack_from(data, offset)[0]
    if start + 4 > len(data):
        raise Damaged("ends within a record")
    fields = read_fields(data[offset + 4 : start])
    record = Record(_op(fields), fields, start + 4, _LENGTH.unpack_from(data, start)[0])
    if record.end > len(data):
        raise Damaged("ends within a record")
    return record


def _op(fields: dict[bytes, bytes]) -> int:
    value = fields.get(b"op", b"")
    if len(value) != 1 or not MESSAGE <= value[0] <= CONNECTION:
        raise Damaged("is of no known kind")
    return value[0]


def find_chunk(file: LogFile, start: int) -> int | None:
    """Return the offset of the first thing from `start` on that can only be a whole chunk record, or None."""
    for begin in range(start, file.size, _WINDOW):
        try:
            window = file.read(begin, _WINDOW + _LONGEST_HEADER)
        except Damaged:  # a part of the disk that cannot be read
            continue
        mark_at = window.find(_MARK)
        while mark_at >= 0:
            for match in _CHUNK_START.finditer(window, max(0, mark_at - _LONGEST_HEADER), mark_at + len(_MARK)):
                if _is_chunk(file, begin + match.start()):
                    return begin + match.start()
            mark_at = window.find(_MARK, mark_at + 1)
    return None


def _is_chunk(file: LogFile, offset: int) -> bool:
    try:
        record = read_record(file, offset)
        size = record.number(b"size")
    except Damaged:
        return False
    compression = record.fields.get(b"compression")
    return record.op == CHUNK and compression in COMPRESSIONS and (compression != b"none" or size == record.length)

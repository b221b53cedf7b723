"""ROS 1 bags (version 2.0) as a container of messages.

The bag is walked record by record and not through its index, so that one that was never closed, as after a power
failure, or was cut, gives what its whole chunks hold.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection, Hashable, Iterator
from pathlib import Path
from typing import NamedTuple

from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.messages.container import Channel, StoredMessage
from scenewright.stages.ingest.messages.damage_lines import HINT, DamageLines
from scenewright.stages.ingest.messages.log_file import Damaged, LogFile
from scenewright.stages.ingest.messages.rosbag1_records import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    COMPRESSIONS,
    CONNECTION,
    INDEX,
    MAGIC,
    MESSAGE,
    Record,
    find_chunk,
    read_fields,
    read_record,
    record_within,
)
from scenewright.stages.kit.formats.bounded_unpacking import unpacked
from scenewright.stages.kit.formats.chunk_cache import ChunkCache

LARGEST_CHUNK = 1 << 30
"""Most unpacked bytes of a chunk; what claims more is taken for a bomb."""
LARGEST_CONNECTION = 16 << 20
"""Bytes of one connection record that are accepted."""
MOST_CONNECTIONS = 65_536
"""Most connections of a bag; a bound against damaged files."""


class Place(NamedTuple):
    """Where a message stands: `chunk` is an index into the chunks, `offset` that of its record in the chunk."""

    chunk: int
    offset: int


class Rosbag1Messages:
    """A ROS 1 bag that is open for reading; see MessageLog."""

    format = "rosbag1"

    def __init__(self, path: Path, *, salvage: bool) -> None:
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.notes: list[str] = []
        self._lines = DamageLines(path, salvage=salvage)
        self.damage: list[str] = self._lines
        self._connections: dict[int, Channel] = {}
        self._chunks = array("Q")
        """Offsets of the chunk records."""
        self._indexed: dict[int, Counter[int]] = {}
        """Chunk -> connection -> messages, as the index behind the chunk says."""
        self._stated: Counter[int] = Counter()
        """Connection -> messages, as the index at the end of the bag says."""
        self._stated_chunks: list[int] = []
        self._indexed_chunk = -1
        """Chunk that index records belong to at this place of the walk; -1 after a damaged one."""
        self._in_index: list[Channel] = []
        """Connections that the index at the end of the bag repeats."""
        self._orphans = 0
        """Messages that indexes of damaged chunks name."""
        self._plain_chunks = 0
        self._examined: set[int] = set()
        self._cache = ChunkCache()
        self._file = LogFile(path, "a ROS 1 bag")
        self._size = self._file.size
        try:
            self._open()
        except Damaged as fault:
            self._file.close()
            raise self._bad(str(fault)) from None
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        self._cache.clear()

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield messages of the channels (None: all) in file order."""
        wanted_ids = None if channel_ids is None else set(channel_ids)
        for index, _ in sorted(enumerate(self._chunks), key=lambda pair: pair[1]):
            yield from self._chunk_messages(index, wanted_ids)

    def fetch(self, location: Hashable) -> StoredMessage:
        """Return the message at a location that `messages` gave. Raises BadInput when it has become unreadable."""
        if not isinstance(location, Place) or not 0 <= location.chunk < len(self._chunks):
            raise BadInput(f"{self.path}: {location!r} is not a place in a ROS 1 bag")
        try:
            data = self._cache.get(location.chunk, self._unpack)
            record = record_within(data, location.offset)
            if record.op != MESSAGE or record.number(b"conn") not in self._connections:
                raise Damaged("holds no message there")
            channel = self._connections[record.number(b"conn")]
            return StoredMessage(channel, record.time(b"time"), data[record.start : record.end], location)
        except Damaged as fault:
            raise self._bad(f"chunk at byte {self._chunks[location.chunk]} {fault}") from None

    # --- structure -------------------------------------------------------------------------------------------

    def _open(self) -> None:
        magic = self._file.read(0, len(MAGIC))
        if magic != MAGIC:
            if magic.startswith(b"#ROSBAG V") and len(magic) == len(MAGIC):
                version = magic[9:].split(b"\n")[0].decode("ascii", "replace")
                raise BadInput(
                    f"{self.path}: is a bag of version {version}, only 2.0 is read", hint="convert it with `rosbag fix`"
                )
            raise self._bad("is empty" if self._size == 0 else "is not a ROS 1 bag (wrong first bytes)")
        closed = self._walk()
        if closed:
            self._find_stated_chunks()
        if not closed or not self._in_index:  # a damaged index is less to be believed than the chunks
            self._find_connections()
        for channel in self._in_index:
            self._define(channel)
        if self._plain_chunks:
            share = f"{self._plain_chunks} of {len(self._chunks)} chunks"
            self.notes.append(f"{share} carry no checksum: changed bytes in them cannot be noticed")
        self.channels = tuple(self._channel(number) for number in sorted(self._connections))
        self._connections = {channel.id: channel for channel in self.channels}

    def _walk(self) -> bool:
        """Visit every top-level record; return whether the bag was closed and its index is whole."""
        offset = scan_from = len(MAGIC)
        header: Record | None = None
        indexed_connections = 0
        torn = False
        while offset < self._size:
            try:
                record = read_record(self._file, offset)
                if offset == len(MAGIC):
                    header = self._bag_header(record)
                elif record.op == CHUNK:
                    self._chunk(record, offset)
                elif record.op == INDEX:
                    self._index(record)
                elif record.op == CONNECTION:
                    indexed_connections += 1
                    self._in_index.append(_connection(record, self._data(record)))
                elif record.op == CHUNK_INFO:
                    self._chunk_info(record)
                else:
                    raise Damaged("stands outside of a chunk")
            except Damaged as fault:
                torn = True
                following = self._skip(offset, scan_from, fault)
                if following is None:
                    break
                offset = scan_from = following
                continue
            scan_from = record.end if record.op == CHUNK else offset + 1
            offset = record.end
        if self._orphans:
            self._lines.found(f"index records behind damaged places name {self._orphans} messages")
        if header is None or torn:
            if not torn:
                self._lines.found("ends before its header")
            return False
        if header.number(b"index_pos", 8) == 0:
            self._lines.found(
                "was not closed, as after a power failure: it has no index, and what was not written is lost"
            )
            return False
        stated = (header.number(b"conn_count"), header.number(b"chunk_count"))
        if stated != (indexed_connections, len(self._stated_chunks)):
            self._lines.found(
                f"states {stated[0]} connections and {stated[1]} chunks, its index holds {indexed_connections} and "
                f"{len(self._stated_chunks)}"
            )
            return False
        return True

    def _bag_header(self, record: Record) -> Record:
        if record.op != BAG_HEADER:
            raise Damaged("is not a bag header")
        encryptor = record.fields.get(b"encryptor", b"")
        if encryptor:
            name = encryptor.decode("ascii", "replace")
            raise BadInput(f"{self.path}: is encrypted ({name:.60})", hint="decrypt it with `rosbag decrypt`")
        for field, size in ((b"index_pos", 8), (b"conn_count", 4), (b"chunk_count", 4)):
            record.number(field, size)
        return record

    def _chunk(self, record: Record, offset: int) -> None:
        size, compression = record.number(b"size"), record.fields.get(b"compression", b"")
        if compression == b"none" and size != record.length:
            raise Damaged(f"is a chunk that claims {size} bytes and holds {record.length}")
        self._chunks.append(offset)
        self._indexed_chunk = len(self._chunks) - 1
        self._plain_chunks += compression == b"none" and size > 0

    def _index(self, record: Record) -> None:
        connection, count = record.number(b"conn"), record.number(b"count")
        if self._indexed_chunk < 0:
            self._orphans += count
        else:
            self._indexed.setdefault(self._indexed_chunk, Counter())[connection] += count

    def _chunk_info(self, record: Record) -> None:
        self._stated_chunks.append(record.number(b"chunk_pos", 8))
        data = self._data(record)
        if record.number(b"count") * 8 != len(data):
            raise Damaged("is a chunk info that lies about its length")
        for start_of_entry in range(0, len(data), 8):
            connection = int.from_bytes(data[start_of_entry : start_of_entry + 4], "little")
            self._stated[connection] += int.from_bytes(data[start_of_entry + 4 : start_of_entry + 8], "little")

    def _skip(self, offset: int, scan_from: int, fault: Damaged) -> int | None:
        """Return where reading goes on after a damaged record, and note what is lost; None: nothing follows."""
        self._indexed_chunk = -1
        following = self._own_end(offset)
        if following is None:
            following = find_chunk(self._file, scan_from + (scan_from == offset))
        lost = (self._size if following is None else following) - offset
        fault_text = f"record at byte {offset} of {self._size} {fault}"
        if str(fault) == "ends within it":
            fault_text = f"ends within the record at byte {offset} of {self._size}"
        if following is None:
            self._lines.found(f"{fault_text}: the last {lost} bytes are lost, and what was not written")
        else:
            self._lines.found(f"{fault_text}: {max(lost, 0)} bytes are lost; reading goes on at byte {following}")
        return following

    def _own_end(self, offset: int) -> int | None:
        """Return the end that a damaged record claims when another record begins there, or the file ends."""
        try:
            end = read_record(self._file, offset).end
            if end < self._size:
                read_record(self._file, end)
        except Damaged:
            return None
        return end

    def _find_stated_chunks(self) -> None:
        """A chunk that the index names and the walk did not meet lies behind a damaged length."""
        met = set(self._chunks)
        for offset in self._stated_chunks:
            if offset in met:
                continue
            try:
                record = read_record(self._file, offset)
                if record.op != CHUNK:
                    raise Damaged("is not a chunk")
                self._chunk(record, offset)
                self._lines.found(f"a record before the chunk at byte {offset} lies about its length")
            except Damaged as fault:
                self._lines.found(f"chunk at byte {offset}, which the index names, {fault}: it is lost")

    def _find_connections(self) -> None:
        """Collect the connections from the chunks of a bag without a whole index."""
        self._stated = Counter()
        for index in range(len(self._chunks)):
            counts_here: Counter[int] = Counter()
            try:
                data, offset = self._unpack(index), 0
                while offset < len(data):
                    record = record_within(data, offset)
                    if record.op == CONNECTION:
                        self._define(_connection(record, data[record.start : record.end]))
                    elif record.op == MESSAGE:
                        counts_here[record.number(b"conn")] += 1
                    offset = record.end
            except Damaged as fault:
                self._chunk_damage(index, fault, counts_here)
            self._stated.update(counts_here)

    def _define(self, channel: Channel) -> None:
        """Take in a connection; one that contradicts an earlier one is damage, and the earlier one stays."""
        number = channel.id
        if number not in self._connections and len(self._connections) >= MOST_CONNECTIONS:
            raise Damaged(f"has more than the {MOST_CONNECTIONS} connections that are accepted")
        first_channel = self._connections.setdefault(number, channel)
        if (first_channel.topic, first_channel.type_name, first_channel.schema) != (
            channel.topic,
            channel.type_name,
            channel.schema,
        ):
            names = f"as {first_channel.topic!r} and as {channel.topic!r}"
            self._lines.found(f"connection {number} is defined twice, {names}: the first is used")

    def _channel(self, number: int) -> Channel:
        channel = self._connections[number]
        return Channel(
            number, channel.topic, channel.type_name, "ros1", "ros1msg", channel.schema, self._stated[number]
        )

    # --- reading ---------------------------------------------------------------------------------------------

    def _chunk_messages(self, index: int, wanted_ids: set[int] | None) -> Iterator[StoredMessage]:
        """Yield the wanted messages of a chunk; what is wrong in it is noted when it is read to its end."""
        counts_here: Counter[int] = Counter()
        first = index not in self._examined
        try:
            data, offset = self._unpack(index), 0
            while offset < len(data):
                record = record_within(data, offset)
                if record.op == MESSAGE:
                    number, time = record.number(b"conn"), record.time(b"time")
                    counts_here[number] += 1
                    channel = self._connections.get(number)
                    if channel is not None and (wanted_ids is None or number in wanted_ids):
                        location = Place(index, offset)
                        yield StoredMessage(channel, time, data[record.start : record.end], location)
                elif record.op == CONNECTION:
                    self._define(_connection(record, data[record.start : record.end]))
                offset = record.end
        except Damaged as fault:
            self._chunk_damage(index, fault, counts_here)
        else:
            stated = self._indexed.get(index)
            if first and stated is not None and counts_here.total() < stated.total():
                self._lines.found(
                    f"chunk at byte {self._chunks[index]} holds {counts_here.total()} messages, "
                    f"its index names {stated.total()}"
                )
        self._examined.add(index)
        for number, times in sorted(counts_here.items() if first else ()):
            if number not in self._connections:
                self._lines.found(f"a message belongs to connection {number}, which the bag does not define", times)

    def _chunk_damage(self, index: int, fault: Damaged, counts_here: Counter[int]) -> None:
        stated = self._indexed.get(index)
        count = "no index says how many messages" if stated is None else f"{stated.total()} messages by its index"
        consequence = f"all but its first {counts_here.total()} messages are lost" if counts_here else "it is lost"
        self._lines.found(f"chunk at byte {self._chunks[index]} ({count}) {fault}: {consequence}")

    def _unpack(self, index: int) -> bytes:
        record = read_record(self._file, self._chunks[index])
        size = record.number(b"size")
        if max(size, record.length) > LARGEST_CHUNK:
            raise Damaged(f"claims {max(size, record.length)} bytes, more than {LARGEST_CHUNK}")
        compression = record.fields.get(b"compression", b"").decode("ascii", "replace")
        try:
            if record.fields.get(b"compression") not in COMPRESSIONS:
                raise ValueError(f"uses unknown compression {compression!r:.40}")
            return unpacked(self._file.exactly(record.start, record.length), compression, size)
        except ValueError as error:
            raise Damaged(str(error)) from None

    def _data(self, record: Record) -> bytes:
        if record.length > LARGEST_CONNECTION:
            raise Damaged(f"has {record.length} bytes, more than the {LARGEST_CONNECTION} that are accepted")
        return self._file.exactly(record.start, record.length)

    def _bad(self, fault: str) -> BadInput:
        return BadInput(f"{self.path}: {fault}", hint=HINT)


def open_rosbag1(path: Path, *, salvage: bool) -> Rosbag1Messages:
    """Open a ROS 1 bag. Raises BadInput when it is none, is encrypted or of version 1; without `salvage` also when it
    is torn or damaged."""
    return Rosbag1Messages(path, salvage=salvage)


def _connection(record: Record, data: bytes) -> Channel:
    """Return what a connection record defines. Raises Damaged."""
    number, fields = record.number(b"conn"), read_fields(data)
    try:
        topic, type_name = record.fields[b"topic"].decode(), fields[b"type"].decode()
        return Channel(number, topic, type_name, "ros1", "ros1msg", fields[b"message_definition"])
    except (KeyError, UnicodeDecodeError):
        raise Damaged("is a connection without topic, type or message definition") from None

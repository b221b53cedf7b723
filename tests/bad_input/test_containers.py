"""Damaged and lying containers: refused in words, or read as far as they are whole, with what was lost. Never more."""

from __future__ import annotations

import bz2
import functools
import os
import random
import re
import sqlite3
import struct
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import lz4.frame
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.messages.container import MessageLog
from scenewright.stages.ingest.messages.mcap_container import open_mcap
from scenewright.stages.ingest.messages.mcap_log import McapLog
from scenewright.stages.ingest.messages.mcap_records import MAGIC
from scenewright.stages.ingest.messages.opening import open_message_log
from scenewright.stages.ingest.messages.rosbag1_container import open_rosbag1
from scenewright.stages.ingest.messages.rosbag2_container import open_rosbag2

from tests.bad_input.damages import flipped, replaced
from tests.unit.ingest.container_logs import (
    CompressionMode,
    CompressionType,
    IndexType,
    Message,
    StoragePlugin,
    bag1_records,
    mcap_channel,
    mcap_chunk,
    mcap_file,
    mcap_message,
    mcap_record,
    mcap_records,
    read_messages,
    some_messages,
    write_bag1,
    write_bag2,
    write_mcap,
)

MESSAGES = some_messages()
WITHOUT_SUMMARY = {
    "index_types": IndexType.NONE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
}


def _salvaged(path: Path) -> tuple[list[Message], list[str]]:
    """Return what can be read of a damaged log, and its damage."""
    log = open_message_log(path, salvage=True)
    try:
        messages = read_messages(log)
        damage = list(log.damage)
        assert read_messages(log) == messages and list(log.damage) == damage, "a second reading differs"
        return messages, damage
    finally:
        log.close()


def _refused(path: Path) -> str:
    """Return the words with which a damaged log is refused when nothing is to be salvaged."""
    with pytest.raises(BadInput) as caught:
        read_messages(open_message_log(path, salvage=False))
    assert path.name in str(caught.value) and "\n" not in str(caught.value)
    return str(caught.value)


def _write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


@contextmanager
def _at_most(peak: float) -> Iterator[None]:
    """Fail when more bytes than this are allocated at any time."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < peak
    finally:
        tracemalloc.stop()


# --- cuts --------------------------------------------------------------------------------------------------------


def _mcap_ends(path: Path) -> list[int]:
    """Return for every message the end of the chunk that holds it, or of itself."""
    records = mcap_records(path.read_bytes())
    chunks = [end for opcode, _, end in records if opcode == Opcode.CHUNK]
    loose = [end for opcode, _, end in records if opcode == Opcode.MESSAGE]
    with McapLog(path) as log:
        places = [message.location for message in log.messages()]
    return [chunks[place.chunk] if place.chunk >= 0 else loose[k] for k, place in enumerate(places)]


def _bag1_ends(path: Path) -> list[int]:
    """Return for every message the end of its chunk; chunks hold messages in the order of the list."""
    data = path.read_bytes()
    ends: list[int] = []
    chunk = 0
    for op, start, end in bag1_records(data):
        if op == 5:
            chunk = end
        elif op == 4:
            (length,) = struct.unpack_from("<I", data, start)
            ends += [chunk] * (struct.unpack_from("<I", data, start + 4 + length)[0] // 12)
    return ends


WRITERS: dict[str, dict[str, Any]] = {
    "zstd": {},
    "plain": {"compression": CompressionType.NONE},
    "lz4, no summary": {"compression": CompressionType.LZ4, **WITHOUT_SUMMARY},
    "no chunks": {"use_chunking": False},
    "checksum of all data": {"enable_data_crcs": True, "enable_crcs": False},
}
MCAP = {
    f"{name}.mcap": functools.partial(write_mcap, messages=MESSAGES, **options) for name, options in WRITERS.items()
}
BAG1 = {f"{k}.bag": functools.partial(write_bag1, messages=MESSAGES, packing=k) for k in ("none", "bz2", "lz4")}


@pytest.mark.parametrize("name", [*MCAP, *BAG1])
def test_what_is_cut_gives_the_messages_of_its_whole_chunks(tmp_path: Path, name: str) -> None:
    path = (MCAP | BAG1)[name](tmp_path / name)
    whole = path.read_bytes()
    records = (mcap_records if name in MCAP else bag1_records)(whole)
    ends = (_mcap_ends if name in MCAP else _bag1_ends)(path)
    assert len(ends) == len(MESSAGES)
    cuts = {place + step for _, start, end in records for place in (start, end) for step in (-1, 0, 1)}
    for cut in sorted({cut for cut in {*cuts, len(whole) - 4} if cut < len(whole)}):
        words = _refused(_write(path, whole[:cut]))
        if cut < records[0][1]:
            assert name in BAG1 or "wrong first bytes" in words
            continue
        messages, damage = _salvaged(path)
        assert messages == [message for message, end in zip(MESSAGES, ends, strict=True) if end <= cut], cut
        assert len(damage) == 1, damage
        if name in MCAP:
            _says_where(damage[0], records, cut)


def _says_where(damage: str, records: list[tuple[int, int, int]], cut: int) -> None:
    """Check that what is said of a cut MCAP names the place, and what is lost."""
    starts = [start for _, start, _ in records]
    data_end = next(start for opcode, start, _ in records if opcode == Opcode.DATA_END)
    if cut >= data_end + 13:
        assert "no message is lost" in damage
    elif cut not in starts:
        start = max(start for start in starts if start < cut)
        assert f"byte {start}" in damage and f"last {cut - start} bytes" in damage


def test_mcap_that_was_not_closed(tmp_path: Path) -> None:
    """What a power failure leaves: the end of the file missing, or zeros in its place."""
    path = write_mcap(tmp_path / "log.mcap", MESSAGES)
    whole = path.read_bytes()
    records = mcap_records(whole)
    cut = [start for opcode, start, _ in records if opcode == Opcode.CHUNK][-1]
    kept = [m for m, end in zip(MESSAGES, _mcap_ends(path), strict=True) if end <= cut]
    for tail, complaint in ((b"", "was not closed"), (bytes(10_000), "last 10000 bytes are lost")):
        messages, damage = _salvaged(_write(path, whole[:cut] + tail))
        assert messages == kept and complaint in damage[0]
        assert "whole chunks with" in _refused(path)


# --- MCAP: changed bytes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["zstd", "lz4, no summary", "no chunks"])
def test_mcap_with_a_changed_byte_in_every_record(tmp_path: Path, name: str) -> None:
    """Refused or harmless; salvaged without what was changed; never anything that was not written."""
    path = write_mcap(tmp_path / "log.mcap", MESSAGES, **WRITERS[name])
    whole = path.read_bytes()
    checked = "enable_crcs" not in WRITERS[name] and name != "no chunks"
    for opcode, start, end in mcap_records(whole):
        for place in {start, start + 1, start + 3, start + 8, start + 9, (start + 9 + end) // 2, end - 1}:
            _write(path, flipped(whole, place))
            messages, damage = _salvaged(path)
            if checked:
                assert set(messages) <= set(MESSAGES)
                assert damage or messages == MESSAGES, f"{Opcode(opcode).name} at {place - start} lost in silence"
            try:
                strict = read_messages(open_mcap(path, salvage=False))
            except BadInput as error:
                assert "log.mcap" in str(error) and damage
            else:
                assert not damage and (strict == MESSAGES or not checked)


def test_mcap_changed_bytes_are_found_wherever_content_is(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", MESSAGES)
    whole = path.read_bytes()
    in_summary = False
    for opcode, start, end in mcap_records(whole):
        if in_summary or opcode in (Opcode.CHUNK, Opcode.ATTACHMENT):
            places = [end - 1, (start + end) // 2 + 20 if opcode == Opcode.CHUNK else (start + 9 + end) // 2]
            for place in places:
                _refused(_write(path, flipped(whole, place)))
        in_summary |= opcode == Opcode.DATA_END
    whole = write_mcap(path, MESSAGES, enable_data_crcs=True).read_bytes()
    for opcode, _, end in mcap_records(whole):
        if opcode in (Opcode.METADATA, Opcode.MESSAGE_INDEX, Opcode.HEADER):
            _refused(_write(path, flipped(whole, end - 1)))


def test_mcap_damage_costs_no_more_than_its_chunk(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", MESSAGES)
    whole = path.read_bytes()
    records = mcap_records(whole)
    chunk_of = _mcap_ends(path)
    for opcode, start, end in records:
        for place in (start, start + 1, start + 2, start + 7, start + 9):
            if place >= end - 1:
                continue
            messages, damage = _salvaged(_write(path, flipped(whole, place, 0x41)))
            in_chunk = opcode == Opcode.CHUNK and place not in (start, start + 9)  # opcode, start time: no content
            lost = [m for m, chunk in zip(MESSAGES, chunk_of, strict=True) if in_chunk and chunk == end]
            assert messages == [m for m in MESSAGES if m not in lost], (Opcode(opcode).name, place - start)
            assert (
                damage
                or place == start + 9
                or any("unknown kinds" in note for note in open_mcap(path, salvage=True).notes)
            )


def test_mcap_says_how_many_messages_a_lost_chunk_had(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", MESSAGES)
    whole = path.read_bytes()
    records = mcap_records(whole)
    start, end = [(start, end) for opcode, start, end in records if opcode == Opcode.CHUNK][1]
    lost = _mcap_ends(path).count(end)
    _write(path, flipped(whole, start + 9 + 28))  # the length of the compression's name
    messages, damage = _salvaged(path)
    assert len(messages) == len(MESSAGES) - lost
    assert any(f"byte {start}" in line and f"{end - start} bytes are lost" in line for line in damage)
    assert f"message indexes behind damaged places name {lost} messages" in damage


def test_mcap_chunk_with_a_wrong_checksum_is_skipped(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", MESSAGES, compression=CompressionType.NONE)
    whole = path.read_bytes()
    chunks = [(start, end) for opcode, start, end in mcap_records(whole) if opcode == Opcode.CHUNK]
    start, end = chunks[2]
    lost = [m for m, chunk in zip(MESSAGES, _mcap_ends(path), strict=True) if chunk == end]
    messages, damage = _salvaged(_write(path, flipped(whole, end - 5)))
    assert messages == [m for m in MESSAGES if m not in lost]
    assert damage == [f"chunk at byte {start} ({len(lost)} messages by its index) has a wrong checksum: it is lost"]
    log = open_mcap(path, salvage=True)
    assert list(log.damage) == []  # found while reading, not before
    assert "wrong checksum" in _refused(path)
    places = [message.location for message in log.messages()]
    assert [log.fetch(place).data for place in places] == [data for _, _, data in messages]
    lost_place = type(places[0])(2, 9)
    with pytest.raises(BadInput, match="wrong checksum"):
        log.fetch(lost_place)


def test_mcap_definitions_survive_a_damaged_summary(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", MESSAGES)
    whole = path.read_bytes()
    place = whole.rindex(b"Type_a")
    messages, damage = _salvaged(_write(path, flipped(whole, place)))
    assert messages == MESSAGES and len(damage) == 1 and "summary" in damage[0]
    log = open_mcap(path, salvage=True)
    assert {channel.type_name for channel in log.channels} == {"Type_a", "Type_b"}


# --- MCAP: claims ------------------------------------------------------------------------------------------------


def test_mcap_records_that_claim_more_than_there_is(tmp_path: Path) -> None:
    """A metadata record of 2 GiB in a file of a few bytes, and a true one that is larger than any we accept."""
    path = tmp_path / "log.mcap"
    whole = mcap_file(mcap_channel(1, "/x"), mcap_chunk(mcap_message(1, 5, b"good")))
    body = whole[: whole.index(mcap_record(Opcode.DATA_END, bytes(4)))]
    for opcode in (
        Opcode.METADATA,
        Opcode.SCHEMA,
        Opcode.CHANNEL,
        Opcode.ATTACHMENT,
        Opcode.MESSAGE_INDEX,
        Opcode.MESSAGE,
    ):
        path.write_bytes(body + struct.pack("<BQ", opcode, 2 << 30) + bytes(100))
        with _at_most(20e6):
            assert "ends within the record" in _refused(path)
            assert _salvaged(path)[0] == [("/x", 5, b"good")]
    path.write_bytes(body + struct.pack("<BQ", Opcode.METADATA, 100 << 20))
    os.truncate(path, path.stat().st_size + (100 << 20))
    with _at_most(20e6):
        messages, damage = _salvaged(path)
    assert messages == [("/x", 5, b"good")] and "more than the" in damage[0]


def test_mcap_metadata_is_bounded_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scenewright.stages.ingest.messages.mcap_structure.MOST_DEFINITIONS", 10_000)
    metadata = mcap_record(Opcode.METADATA, struct.pack("<I", 1) + b"n" + struct.pack("<I", 0))
    path = _write(tmp_path / "log.mcap", mcap_file(mcap_channel(1, "/x"), *[metadata] * 100, mcap_message(1, 5, b"m")))
    messages, damage = _salvaged(path)
    assert len(messages) == 1 and "bytes of definitions" in damage[0]


@pytest.mark.parametrize("suffix", [".mcap", ".bag", ".db3"])
def test_paths_that_are_no_files(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / ("log" + suffix)
    opener: Callable[..., MessageLog] = {".mcap": open_mcap, ".bag": open_rosbag1, ".db3": open_rosbag2}[suffix]
    with pytest.raises(BadInput, match="missing"):
        opener(path, salvage=True)
    for content, complaint in (
        (b"", "is empty"),
        (b"Nothing of the kind, but longer.", "wrong first bytes|is neither"),
    ):
        with pytest.raises(BadInput, match=complaint):
            opener(_write(path, content), salvage=True)
    path.unlink()
    path.mkdir()
    with pytest.raises(BadInput, match="is a folder|no part of the bag"):
        opener(path, salvage=True)
    path.rmdir()
    os.mkfifo(path)
    for open_it in (opener, open_message_log):
        with pytest.raises(BadInput):
            open_it(path, salvage=True)


# --- ROS 1 bags ------------------------------------------------------------------------------------------------


def test_bag1_that_was_not_closed(tmp_path: Path) -> None:
    """As a power failure leaves it: the header has no place of an index, and there is none."""
    path = write_bag1(tmp_path / "log.bag", MESSAGES)
    whole = bytearray(path.read_bytes())
    place = whole.index(b"index_pos=") + 10
    (index,) = struct.unpack_from("<Q", whole, place)
    whole[place : place + 8] = bytes(8)
    messages, damage = _salvaged(_write(path, bytes(whole[:index])))
    assert messages == MESSAGES and len(damage) == 1 and "was not closed" in damage[0]
    assert "was not closed" in _refused(path)
    assert _salvaged(_write(path, bytes(whole[: index - 40])))[0] == MESSAGES
    assert _salvaged(_write(path, bytes(whole[:index]) + bytes(5000)))[0] == MESSAGES


def test_bag1_with_a_changed_byte_in_every_record(tmp_path: Path) -> None:
    path = write_bag1(tmp_path / "log.bag", MESSAGES, packing="bz2")
    whole = path.read_bytes()
    ends = _bag1_ends(path)
    for op, start, end in bag1_records(whole):
        for place in {start, start + 1, start + 3, start + 5, start + 9, (start + end) // 2, end - 1}:
            messages, damage = _salvaged(_write(path, flipped(whole, place)))
            lost = [m for m, chunk in zip(MESSAGES, ends, strict=True) if op == 5 and chunk == end]
            if op != 7:  # a connection whose definition changed is told from the one in the chunks
                assert messages in ([m for m in MESSAGES if m not in lost], MESSAGES)
            if messages != MESSAGES:
                assert damage
                _refused(path)


# --- rosbag2 ---------------------------------------------------------------------------------------------------


def test_bag2_with_missing_and_damaged_parts(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    for index in range(3):
        write_mcap(folder.with_name(f"{index}.mcap"), MESSAGES[index * 10 : index * 10 + 10])
    folder.mkdir()
    names = [f"{index}.mcap" for index in range(3)]
    for name in names:
        (tmp_path / name).rename(folder / name)
    listed = "\n".join(f"  - {name}" for name in names)
    metadata = f"rosbag2_bagfile_information:\n  message_count: 30\n  relative_file_paths:\n{listed}\n"
    (folder / "metadata.yaml").write_text(metadata)
    assert _salvaged(folder) == (MESSAGES[:30], [])
    (folder / "1.mcap").write_bytes((folder / "1.mcap").read_bytes()[:-1])
    messages, damage = _salvaged(folder)
    assert messages == MESSAGES[:30] and len(damage) == 1 and damage[0].startswith("1.mcap: ")
    _refused(folder / "1.mcap")
    (folder / "1.mcap").write_bytes(b"")
    assert _salvaged(folder) == (MESSAGES[:10] + MESSAGES[20:30], ["part 1.mcap: is empty"])
    (folder / "1.mcap").unlink()
    messages, damage = _salvaged(folder)
    assert messages == MESSAGES[:10] + MESSAGES[20:30] and len(damage) == 1 and "1.mcap: file is missing" in damage[0]
    with pytest.raises(BadInput, match="1.mcap: file is missing"):
        open_message_log(folder, salvage=False)
    for name in ("0.mcap", "2.mcap"):
        (folder / name).unlink()
    with pytest.raises(BadInput, match="no part of the bag can be read"):
        open_message_log(folder, salvage=True)


def test_bag2_database_cut_or_with_a_lost_page(tmp_path: Path) -> None:
    """What stands on whole pages is read; the rest is named. SQLite has no checksums, so that structure must tell."""
    messages = some_messages(400)
    path = write_bag2(tmp_path / "bag", messages) / "bag.db3"
    whole = path.read_bytes()
    pages = len(whole) // 4096
    salvaged_some = 0
    for page in random.Random(0).sample(range(3, pages), 12):
        _write(path, whole[: page * 4096] + b"\xff" * 4096 + whole[(page + 1) * 4096 :])
        found, damage = _salvaged(path)
        assert damage and set(found) <= set(messages)
        _refused(path)
        salvaged_some += len(found) > 300
    assert salvaged_some > 6
    for cut in (100, 4096, 5000, len(whole) // 2, len(whole) - 1):
        _write(path, whole[:cut])
        _refused(path)
        try:
            found, damage = _salvaged(path)
        except BadInput as error:
            assert cut < 10_000, error
        else:
            assert damage and set(found) <= set(messages)


def test_bag2_database_whose_pages_lead_in_a_circle(tmp_path: Path) -> None:
    messages = some_messages(400)
    path = write_bag2(tmp_path / "bag", messages) / "bag.db3"
    with sqlite3.connect(path) as database:
        (root,) = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'").fetchone()
    data = bytearray(path.read_bytes())
    page = (root - 1) * 4096
    first, second = struct.unpack_from(">HH", data, page + 12)  # cells of an interior page: child, then key
    data[page + second : page + second + 4] = data[page + first : page + first + 4]
    _write(path, bytes(data))
    found, damage = _salvaged(path)
    assert len(found) == len(set(found)) > 300 and set(found) <= set(messages)
    assert any("lead in a circle" in line for line in damage)
    _refused(path)


def test_bag2_whose_messages_are_damaged_or_bombs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_bag2(tmp_path / "bag", MESSAGES, mode=CompressionMode.MESSAGE)
    with sqlite3.connect(folder / "bag.db3") as database:
        database.execute("UPDATE messages SET data = ? WHERE id = 3", (zstandard.compress(bytes(10**8)),))
        database.execute("UPDATE messages SET data = x'0011' WHERE id = 5")
    monkeypatch.setattr("scenewright.stages.ingest.messages.rosbag2_container.LARGEST_MESSAGE", 1 << 20)
    with _at_most(20e6):
        messages, damage = _salvaged(folder)
    assert messages == [m for k, m in enumerate(MESSAGES) if k not in (2, 4)]
    assert len(damage) == 2 and any("holds more than 1048576 bytes" in line for line in damage)
    with pytest.raises(BadInput, match="a packed message"):
        read_messages(open_message_log(folder, salvage=False))


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_bag2_packed_parts_that_are_cut_or_bombs(
    tmp_path: Path, storage: StoragePlugin, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_bag2(tmp_path / "bag", MESSAGES, storage=storage, mode=CompressionMode.FILE)
    part = next(folder.glob("*.zstd"))
    packed = part.read_bytes()
    part.write_bytes(packed[: len(packed) // 2])
    with pytest.raises(BadInput, match="bag.*zstd") as caught:
        read_messages(open_message_log(folder, salvage=False))
    assert "scenewright-" not in str(caught.value)
    try:
        assert set(_salvaged(folder)[0]) <= set(MESSAGES)
    except BadInput as error:
        assert "no part of the bag" in str(error)
    monkeypatch.setattr("scenewright.stages.ingest.messages.rosbag2_container.ALWAYS_ACCEPTED", 1 << 20)
    content = b"SQLite format 3\0" if storage == StoragePlugin.SQLITE3 else MAGIC
    bomb = zstandard.ZstdCompressor(write_content_size=False).compress(content + bytes(10**8))
    part.write_bytes(bomb)
    with _at_most(60e6), pytest.raises(BadInput, match="holds more than"):
        open_message_log(folder, salvage=False)


# --- lies ------------------------------------------------------------------------------------------------------


class Lie(NamedTuple):
    """A log that says what is not so, and what comes of it."""

    make: Callable[[Path], Path]
    """Writes it into a folder and returns its path."""
    words: str = ""
    """Of the refusal, where nothing is to be salvaged."""
    kept: list[Message] | None = MESSAGES
    """What is salvaged all the same; None: nothing, the log is refused in the same words."""
    damage: str | list[str] = ""
    """Of what is counted: every line, or words of one of them. Without either: those of the refusal."""


GOOD = mcap_message(1, 5, b"good")
GOOD_CHUNK = mcap_chunk(GOOD)
TWO_GOOD = [("/x", 5, b"good")] * 2
HEADLESS = struct.pack("<BQ", Opcode.MESSAGE, 3) + b"abc"
STATISTICS = struct.pack("<QHIIIIQQ", 3, 0, 1, 0, 0, 0, 0, 0) + struct.pack("<I", 10) + struct.pack("<HQ", 1, 3)
WHOLE = mcap_file(mcap_channel(1, "/x"), GOOD)


def of(name: str, data: bytes) -> Callable[[Path], Path]:
    """Return a maker of a file."""
    return lambda folder: _write(folder / name, data)


def of_records(*records: bytes) -> Callable[[Path], Path]:
    """Return a maker of an MCAP file with a channel and these records."""
    return of("log.mcap", mcap_file(mcap_channel(1, "/x"), *records))


def with_statistics(data: bytes, record: bytes) -> bytes:
    """Return an MCAP file with a summary of a channel and a record."""
    end = data.index(mcap_record(Opcode.FOOTER, bytes(20)))
    return data[:end] + mcap_channel(1, "/x") + record + data[end:]


MCAP_CHUNKS: dict[str, tuple[bytes, str]] = {
    "expands": (mcap_chunk(zstandard.compress(bytes(10**8)), 1000, b"zstd"), "lies about its size"),
    "claims much": (mcap_chunk(zstandard.compress(bytes(1000)), 1 << 40, b"zstd"), f"more than {1 << 30}"),
    "claims more": (mcap_chunk(zstandard.compress(bytes(1000)), 1 << 29, b"zstd"), "holds 1000 bytes and claims"),
    "claims less": (mcap_chunk(zstandard.compress(bytes(1000)), 999, b"zstd"), "holds more than 999 bytes"),
    "claims nothing": (mcap_chunk(zstandard.compress(bytes(1000)), 0, b"zstd"), "holds more than 0 bytes"),
    "nonsense": (mcap_chunk(b"nonsense", 100, b"zstd"), "cannot be unpacked"),
    "lz4 nonsense": (mcap_chunk(b"nonsense", 100, b"lz4"), "cannot be unpacked"),
    "lz4 expands": (mcap_chunk(lz4.frame.compress(bytes(10**8)), 1000, b"lz4"), "holds more than 1000 bytes"),
    "lz4 claims more": (mcap_chunk(lz4.frame.compress(bytes(1000)), 1 << 29, b"lz4"), "holds 1000 bytes and claims"),
    "lz4 cut": (mcap_chunk(lz4.frame.compress(os.urandom(1000))[:-200], 1000, b"lz4"), "claims 1000"),
    "plain claims more": (mcap_chunk(bytes(50), 100), "holds 50 bytes and claims 100"),
    "other packing": (mcap_chunk(bytes(50), 50, b"rar"), "unknown compression 'rar'"),
    "ends within": (mcap_chunk(b"\x05\xff\xff\xff\xff\xff\xff\xff\x7f"), "ends within a record"),
    "no checksum holds": (mcap_chunk(mcap_message(1, 0, b"."), None, b"", 77), "wrong checksum"),
    "undefined": (mcap_chunk(mcap_message(9, 0, b".")), "channel 9, which the file does not define"),
    "headless": (mcap_chunk(HEADLESS), "shorter than its header"),
}
MCAP_FIELDS = {
    "channel": mcap_record(Opcode.CHANNEL, struct.pack("<HHI", 2, 0, 1 << 31) + b"/y"),
    "schema": mcap_record(Opcode.SCHEMA, struct.pack("<HI", 2, 3) + b"abc" + struct.pack("<II", 0, 99)),
    "metadata": mcap_record(Opcode.METADATA, struct.pack("<I", 1) + b"n" + struct.pack("<I", 500)),
    "name": mcap_record(Opcode.CHANNEL, struct.pack("<HHI", 2, 0, 2) + b"\xff\xfe" + bytes(8)),
    "index": mcap_record(Opcode.MESSAGE_INDEX, struct.pack("<HI", 1, 160) + bytes(16)),
    "chunk": mcap_record(Opcode.CHUNK, bytes(10)),
    "statistics": mcap_record(Opcode.STATISTICS, bytes(3)),
}
"""Records with fields that claim more than the record holds."""
TWICE = "channel 1 is defined twice, as '/x' and as '/y'"
MCAP_LIES = {
    **{f"chunk: {k}": Lie(of_records(GOOD_CHUNK, bad, GOOD_CHUNK), w, TWO_GOOD) for k, (bad, w) in MCAP_CHUNKS.items()},
    **{f"field: {k}": Lie(of_records(GOOD, record, GOOD), "", TWO_GOOD) for k, record in MCAP_FIELDS.items()},
    "channel twice": Lie(of_records(GOOD, mcap_channel(1, "/y"), GOOD), TWICE, TWO_GOOD),
    "channel twice, in a chunk": Lie(of_records(mcap_chunk(GOOD + mcap_channel(1, "/y") + GOOD)), TWICE, TWO_GOOD),
    "unknown schema": Lie(
        of("log.mcap", mcap_file(mcap_channel(1, "/x", schema=7), GOOD)),
        "schema 7, which the file does not define",
        TWO_GOOD[:1],
    ),
    "unknown channel": Lie(
        of_records(*[mcap_message(3, 5, b"?")] * 4, GOOD),
        "",
        TWO_GOOD[:1],
        ["4 times: a message belongs to channel 3, which the file does not define"],
    ),
    "statistics": Lie(
        of("log.mcap", with_statistics(mcap_file(mcap_channel(1, "/x"), GOOD, GOOD), mcap_record(11, STATISTICS))),
        "states 3 messages and holds 2",
        TWO_GOOD,
        ["states 3 messages and holds 2"],
    ),
    "more behind its end": Lie(of("log.mcap", WHOLE + b"more"), "more bytes after the footer", TWO_GOOD[:1]),
    "no header": Lie(of("log.mcap", MAGIC + WHOLE[len(MAGIC) + 17 :]), "is not a header", []),
}


def _bag1_header(**fields: bytes) -> bytes:
    content = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value for name, value in fields.items()
    )
    return struct.pack("<I", len(content)) + content


def _bag1_record(data: bytes, **fields: bytes) -> bytes:
    return _bag1_header(**fields) + struct.pack("<I", len(data)) + data


def _bag1(*records: bytes, **header: bytes) -> bytes:
    fields = {"op": b"\x03", "index_pos": bytes(8), "conn_count": bytes(4), "chunk_count": bytes(4)} | header
    return b"#ROSBAG V2.0\n" + _bag1_record(b" " * 10, **fields) + b"".join(records)


def _bag1_chunk(content: bytes, claimed: int | None = None, compression: bytes = b"none") -> bytes:
    size = struct.pack("<I", len(content) if claimed is None else claimed)
    return _bag1_record(content, op=b"\x05", compression=compression, size=size)


def changed_bag1(place: Callable[[bytes], int], content: int | bytes) -> Callable[[Path], Path]:
    """Return a maker of a bag of ROS 1 with bits flipped (an int), or with bytes written over, at a place."""

    def make(folder: Path) -> Path:
        path = write_bag1(folder / "log.bag", MESSAGES)
        whole = path.read_bytes()
        change = flipped if isinstance(content, int) else replaced
        return _write(path, change(whole, place(whole), content))

    return make


def _index_count(whole: bytes) -> int:
    """Return the place of the number of messages that an index record states."""
    place = whole.index(b"op=\x04") - 4
    start = next(start for op, start, end in bag1_records(whole) if start < place < end)
    return whole.index(b"count=", start) + 6


CONNECTION = _bag1_record(
    _bag1_header(type=b"std_msgs/String", md5sum=b"0", message_definition=b"string data")[4:],
    op=b"\x07",
    conn=bytes(4),
    topic=b"/x",
)
GOOD_MESSAGE = _bag1_record(b"good", op=b"\x02", conn=bytes(4), time=bytes(8))
LOST_MESSAGE = _bag1_record(b"lost", op=b"\x02", conn=b"\x05\0\0\0", time=bytes(8))
GOOD_BAG1_CHUNK = _bag1_chunk(CONNECTION + GOOD_MESSAGE)
BAG1_CHUNKS: dict[str, tuple[bytes, str]] = {
    "bz2 expands": (_bag1_chunk(bz2.compress(bytes(10**8)), 1000, b"bz2"), "holds more than 1000 bytes"),
    "lz4 expands": (_bag1_chunk(lz4.frame.compress(bytes(10**8)), 1000, b"lz4"), "holds more than 1000 bytes"),
    "bz2 claims more": (_bag1_chunk(bz2.compress(bytes(1000)), 1 << 29, b"bz2"), "holds 1000 bytes and claims"),
    "lz4 claims much": (_bag1_chunk(lz4.frame.compress(bytes(1000)), (1 << 32) - 1, b"lz4"), f"more than {1 << 30}"),
    "claims nothing": (_bag1_chunk(bz2.compress(bytes(1000)), 0, b"bz2"), "holds more than 0 bytes"),
    "nonsense": (_bag1_chunk(b"nonsense", 100, b"bz2"), "cannot be unpacked"),
    "other packing": (_bag1_chunk(b"nonsense", 100, b"zstd"), "unknown compression 'zstd'"),
    "plain claims more": (_bag1_chunk(bytes(50), 100), "claims 100 bytes and holds 50"),
    "ends within": (_bag1_chunk(GOOD_MESSAGE[:-1]), "ends within a record"),
    "endless header": (_bag1_chunk(b"\xff" * 50), "ends within a record"),
    "undefined": (_bag1_chunk(LOST_MESSAGE), "connection 5, which the bag does not define"),
    "fields missing": (_bag1_chunk(_bag1_record(b"x", op=b"\x02")), "has no field"),
    "field cut": (_bag1_chunk(struct.pack("<III", 8, 99, 0) + bytes(4)), "within a field"),
    "outside": (GOOD_MESSAGE, "stands outside of a chunk"),
}
BAG1_LIES = {
    **{
        f"chunk: {name}": Lie(
            of("log.bag", _bag1(GOOD_BAG1_CHUNK, bad, bad, GOOD_BAG1_CHUNK)), "", [("/x", 0, b"good")] * 2, words
        )
        for name, (bad, words) in BAG1_CHUNKS.items()
    },
    "version 1.2": Lie(of("log.bag", b"#ROSBAG V1.2\n" + bytes(100)), "version 1.2.*rosbag fix", None),
    "encrypted": Lie(of("log.bag", _bag1(encryptor=b"rosbag/AesCbcEncryptor")), "is encrypted .*rosbag decrypt", None),
    "connection twice": Lie(
        changed_bag1(lambda whole: whole.rindex(b"std_msgs/String"), 1), "connection 1 is defined twice"
    ),
    "number of connections": Lie(changed_bag1(lambda whole: whole.index(b"conn_count=") + 11, 1), "states"),
    "number of chunks": Lie(changed_bag1(lambda whole: whole.index(b"chunk_count=") + 12, 1), "states"),
    "number of messages": Lie(changed_bag1(_index_count, 0x10), "its index names"),
    "an index out of the file": Lie(
        changed_bag1(lambda whole: whole.rindex(b"chunk_pos=") + 10, b"\xff" * 8), "which the index names"
    ),
}


def metadata(change: str | Callable[[str], str]) -> Callable[[Path], Path]:
    """Return a maker of a bag of ROS 2 with another metadata.yaml, or another text in it."""

    def make(folder: Path) -> Path:
        bag = write_bag2(folder / "bag", MESSAGES)
        path = bag / "metadata.yaml"
        path.write_text(change(path.read_text()) if callable(change) else change)
        return bag

    return make


def part_named(name: str) -> Callable[[Path], Path]:
    """Return a maker of a bag of ROS 2 whose one part has another name; `outside.db3` lies beside it."""

    def make(folder: Path) -> Path:
        bag = metadata(lambda text: text.replace("- bag.db3", f"- {name.format(folder=folder)}"))(folder)
        write_bag2(folder / "outside", MESSAGES)
        (folder / "outside" / "outside.db3").rename(folder / "outside.db3")
        (bag / "link.db3").symlink_to(folder / "outside.db3")
        (bag / "a").mkdir()
        return bag

    return make


def database(*statements: str) -> Callable[[Path], Path]:
    """Return a maker of a database after these statements."""

    def make(folder: Path) -> Path:
        path = write_bag2(folder / "bag", MESSAGES) / "bag.db3"
        with sqlite3.connect(path) as connection:
            for statement in statements:
                connection.execute(statement)
        return path

    return make


BAG = "rosbag2_bagfile_information"
BAG2_METADATA = {
    "cut": (f"{BAG}:\n  relative_file_paths:\n  - [", "cannot be read"),
    "no list": (f"{BAG}:\n  relative_file_paths: 7\n", "not a list of names"),
    "maps": (f"{BAG}:\n  relative_file_paths: [{{1: 2}}, '']\n", "not a list of names"),
    "no map": (f"{BAG}: []\n", "does not describe a bag"),
    "other content": (f"# {BAG}\n- 1\n", "does not describe a bag"),
    "deep": (f"{BAG}: " + "[" * 100_000, "nested more than"),
    "deep lists": (f"{BAG}: " + "\n" + "- " * 10_000, "nested more than"),
    "merges": (f"{BAG}: {{a: &a {{x: 1}}, b: {{<<: [*a, *a]}}}}", "aliases"),
    "objects": (f"{BAG}: !!python/object/apply:os.system ['true']", "does not describe a bag"),
    "lists as keys": (f"{BAG}: {{[1]: 2}}", "key that is not text"),
    "zero byte": (f'{BAG}:\n  relative_file_paths: ["a\\0b.db3"]\n', "cannot be read"),
    "long": (f"{BAG}:\n" + "# long\n" * 400_000, "larger than"),
    "packed otherwise": (
        f"{BAG}: {{compression_mode: FILE, compression_format: rar, relative_file_paths: []}}",
        "packed with 'rar'",
    ),
}
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, 1, i, x'00' FROM n"
COLUMNS = "id INTEGER PRIMARY KEY, topic_id, timestamp, data GENERATED ALWAYS AS (zeroblob(1e8))"
NO_TABLES = "without the tables of a bag"
BAG2_LIES = {
    **{f"metadata: {name}": Lie(metadata(text), words) for name, (text, words) in BAG2_METADATA.items()},
    **{
        f"name: {name}": Lie(part_named(name), "outside of the folder", None)
        for name in ("../outside.db3", "{folder}/outside.db3", "link.db3", "a/../../outside.db3", "bag/../../x")
    },
    "states more messages": Lie(
        metadata(lambda text: text.replace("message_count: 40", "message_count: 50")),
        "counts 50",
        MESSAGES,
        ["metadata.yaml counts 50 messages, the parts hold 40"],
    ),
    "rows": Lie(
        database(
            "UPDATE messages SET data = 'words' WHERE id = 3",
            "UPDATE messages SET topic_id = 99 WHERE id IN (4, 5)",
            "UPDATE messages SET timestamp = x'00' WHERE id = 6",
        ),
        "",
        MESSAGES[:2] + MESSAGES[6:],
        [
            "2 times: a message belongs to topic 99, which the bag does not define",
            "2 times: a message holds no bytes or no time",
        ],
    ),
    "an endless view": Lie(
        database("DROP TABLE messages", f"CREATE VIEW messages(id, topic_id, timestamp, data) AS {ENDLESS}"),
        NO_TABLES,
        None,
    ),
    "computed bytes": Lie(database("DROP TABLE messages", f"CREATE TABLE messages({COLUMNS})"), NO_TABLES, None),
    "another table of topics": Lie(
        database("DROP TABLE topics", "CREATE TABLE topics(something)"), "table of topics", []
    ),
}
LIES = {
    f"{container}, {name}": lie
    for container, lies in (("mcap", MCAP_LIES), ("bag 1", BAG1_LIES), ("bag 2", BAG2_LIES))
    for name, lie in lies.items()
}


@pytest.mark.parametrize("case", LIES)
def test_lies_are_refused_or_counted(tmp_path: Path, case: str) -> None:
    lie = LIES[case]
    path = lie.make(tmp_path)
    with _at_most(40e6):
        assert re.search(lie.words, _refused(path))
        if lie.kept is None:
            with pytest.raises(BadInput, match=lie.words):
                open_message_log(path, salvage=True)
            return
        messages, damage = _salvaged(path)
    assert messages == lie.kept
    assert damage == lie.damage if isinstance(lie.damage, list) else any((lie.damage or lie.words) in d for d in damage)


def test_a_channel_may_be_defined_twice_alike(tmp_path: Path) -> None:
    path = of_records(GOOD, mcap_channel(1, "/x"), GOOD)(tmp_path)
    assert read_messages(open_mcap(path, salvage=False)) == TWO_GOOD


# --- any damage ------------------------------------------------------------------------------------------------


def _damaged(data: st.DataObject, whole: bytes) -> bytes:
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(whole) - 1)) % len(damaged)
        kind = data.draw(st.sampled_from(["flip", "fill", "cut", "drop", "insert"]))
        if kind == "flip":
            damaged[place] ^= 1 << data.draw(st.integers(0, 7))
        elif kind == "fill":
            damaged[place : place + 8] = b"\xff" * len(damaged[place : place + 8])
        elif kind == "cut":
            del damaged[max(1, place) :]
        elif kind == "drop":
            del damaged[place : place + data.draw(st.integers(1, 300))]
            damaged = damaged or bytearray(b"x")
        else:
            damaged[place:place] = data.draw(st.binary(min_size=1, max_size=40))
    return bytes(damaged)


FUZZ = settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
CHECKED: dict[str, Callable[[Path], Path]] = {
    "log.mcap": lambda path: write_mcap(path, MESSAGES),
    "plain.mcap": lambda path: write_mcap(path, MESSAGES, compression=CompressionType.NONE),
    "torn.mcap": lambda path: write_mcap(path, MESSAGES, **WITHOUT_SUMMARY),
    "log.bag": lambda path: write_bag1(path, MESSAGES, packing="bz2"),
}
UNCHECKED: dict[str, Callable[[Path], Path]] = {
    "loose.mcap": lambda path: write_mcap(path, MESSAGES, use_chunking=False, enable_crcs=False),
    "plain.bag": lambda path: write_bag1(path, MESSAGES),
    "lz4.bag": lambda path: write_bag1(path, MESSAGES, packing="lz4"),
    "bag.db3": lambda path: write_bag2(path.with_suffix(""), MESSAGES) / "bag.db3",
}


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("originals")
    return {name: write(folder / name).read_bytes() for name, write in {**CHECKED, **UNCHECKED}.items()}


@pytest.mark.parametrize("name", [*CHECKED, *UNCHECKED])
@FUZZ
@given(data=st.data())
def test_any_damage_is_bad_input_or_gives_what_was_written(
    tmp_path: Path, originals: dict[str, bytes], name: str, data: st.DataObject
) -> None:
    """With checksums nothing but original messages comes out, and nothing is lost in silence."""
    path = _write(tmp_path / name, _damaged(data, originals[name]))
    for salvage in (True, False):
        try:
            log = open_message_log(path, salvage=salvage)
            messages = read_messages(log)
        except BadInput as error:
            assert name in str(error)
            continue
        if name in CHECKED:
            assert set(messages) <= set(MESSAGES)
            assert log.damage or messages == MESSAGES
        for message in log.messages():
            assert log.fetch(message.location).data == message.data
        log.close()

"""Containers of messages that are whole: every message once, in order, and again by its place."""

from __future__ import annotations

import random
import shutil
import sqlite3
import tracemalloc
from collections import Counter
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.rosbag1 import Reader as Bag1Reader
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.messages.container import MessageLog
from scenewright.stages.ingest.messages.mcap_log import McapLog
from scenewright.stages.ingest.messages.opening import container_of, open_message_log

from tests.real_data import real_data
from tests.unit.ingest.container_logs import (
    DEFINITION,
    CompressionMode,
    CompressionType,
    IndexType,
    Message,
    StoragePlugin,
    mcap_channel,
    mcap_chunk,
    mcap_file,
    mcap_message,
    mcap_record,
    read_messages,
    some_messages,
    write_bag1,
    write_bag2,
    write_mcap,
)

MCAP_OPTIONS = {
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4},
    "plain": {"compression": CompressionType.NONE},
    "no checksums": {"enable_crcs": False},
    "checksum of all data": {"enable_data_crcs": True},
    "no indexes": {"index_types": IndexType.NONE},
    "no summary": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
    "no chunks": {"use_chunking": False},
    "no chunks, no summary": {
        "use_chunking": False,
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
    },
}


def _check(log: MessageLog, expected: list[Message]) -> None:
    """Read all, some, and every message by its place in any order."""
    assert read_messages(log) == expected
    assert read_messages(log) == expected
    assert {channel.topic: channel.count for channel in log.channels} == Counter(topic for topic, _, _ in expected)
    chosen = [channel.id for channel in log.channels if channel.topic == "/b"]
    some = [(m.channel.topic, m.log_time, m.data) for m in log.messages(chosen)]
    assert some == [message for message in expected if message[0] == "/b"]
    places = [(message.location, message) for message in log.messages()]
    random.Random(0).shuffle(places)
    for place, message in places:
        assert log.fetch(place) == message
    assert log.damage == []


@pytest.mark.parametrize("salvage", [False, True])
@pytest.mark.parametrize("name", MCAP_OPTIONS)
def test_mcap_of_every_make(tmp_path: Path, name: str, salvage: bool) -> None:
    path = write_mcap(tmp_path / "log.mcap", some_messages(), **MCAP_OPTIONS[name])
    assert container_of(path) == "mcap"
    log = open_message_log(path, salvage=salvage)
    _check(log, some_messages())
    assert log.metadata == {"first": {"key": "value"}}
    assert [(c.type_name, c.message_encoding, c.schema_encoding, c.schema) for c in log.channels] == [
        ("Type_b", "cdr", "ros2msg", DEFINITION.encode()),
        ("Type_a", "cdr", "ros2msg", DEFINITION.encode()),
    ]
    assert bool(log.notes) == (name in ("no checksums", "no chunks", "no chunks, no summary"))
    log.close()


def test_mcap_chunks_without_checksum_are_counted(tmp_path: Path) -> None:
    with McapLog(write_mcap(tmp_path / "a.mcap", some_messages(), enable_crcs=False)) as log:
        assert log.unchecked_chunks == len({message.location.chunk for message in log.messages()}) > 3
    with McapLog(write_mcap(tmp_path / "b.mcap", some_messages(), enable_crcs=False, enable_data_crcs=True)) as log:
        assert log.unchecked_chunks == 0


def test_mcap_indexes_agree_with_the_messages(tmp_path: Path) -> None:
    with McapLog(write_mcap(tmp_path / "log.mcap", some_messages())) as log:
        for channel in log.channels:
            indexed = list(log.indexed(channel))
            assert indexed == [(m.log_time, m.location) for m in log.messages([channel])]
        assert list(log.indexed(77)) == []


def test_mcap_of_odd_records(tmp_path: Path) -> None:
    """Loose messages between chunks keep their order; channels without schema, unknown records and no messages."""
    path = tmp_path / "log.mcap"
    chunk = mcap_chunk(mcap_message(1, 1, b"one") + mcap_record(0x99, b"?") + mcap_message(1, 2, b"two"))
    loose = mcap_message(1, 3, b"three")
    path.write_bytes(mcap_file(mcap_channel(1, "/x"), mcap_record(0x80, b"private"), chunk, loose, chunk))
    log = open_message_log(path, salvage=False)
    assert [data for _, _, data in read_messages(log)] == [b"one", b"two", b"three", b"one", b"two"]
    assert log.channels[0].type_name == log.channels[0].schema_encoding == "" and log.channels[0].count == 5
    assert any("1 records of unknown kinds" in note for note in log.notes)
    path.write_bytes(mcap_file())
    assert read_messages(open_message_log(path, salvage=False)) == []


@pytest.mark.parametrize("salvage", [False, True])
@pytest.mark.parametrize("packing", ["none", "bz2", "lz4"])
def test_bag1_in_every_packing(tmp_path: Path, packing: str, salvage: bool) -> None:
    path = write_bag1(tmp_path / "log.bag", some_messages(), packing=packing)
    assert container_of(path) == "rosbag1"
    log = open_message_log(path, salvage=salvage)
    _check(log, some_messages())
    channel = log.channels[0]
    assert (channel.type_name, channel.message_encoding) == ("std_msgs/String", "ros1")
    assert (channel.schema_encoding, channel.schema) == ("ros1msg", DEFINITION.encode())
    with Bag1Reader(path) as reader:
        assert read_messages(log) == [(c.topic, time, bytes(data)) for c, time, data in reader.messages()]
    assert bool(log.notes) == (packing == "none")
    log.close()


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_bag2_of_every_make(tmp_path: Path, storage: StoragePlugin, mode: CompressionMode) -> None:
    path = write_bag2(tmp_path / "bag", some_messages(), storage=storage, mode=mode)
    assert container_of(path) == "rosbag2"
    before = sorted((file.name, file.stat().st_mtime_ns) for file in path.iterdir())
    log = open_message_log(path, salvage=False)
    _check(log, some_messages())
    channel = log.channels[0]
    assert (channel.type_name, channel.message_encoding) == ("std_msgs/msg/String", "cdr")
    assert (channel.schema_encoding, channel.schema.decode()) == ("ros2msg", DEFINITION)
    log.close()
    assert sorted((file.name, file.stat().st_mtime_ns) for file in path.iterdir()) == before


def _split(tmp_path: Path, parts: int) -> Path:
    """Write a bag of 12 parts, of which the names sort wrongly as text."""
    folder = tmp_path / "split"
    folder.mkdir()
    messages = some_messages(parts * 4)
    for index in range(parts):
        write_bag2(tmp_path / f"part{index}", messages[index * 4 : index * 4 + 4])
        shutil.move(tmp_path / f"part{index}" / f"part{index}.db3", folder / f"bag_{index}.db3")
    return folder


def test_bag2_in_parts_without_metadata(tmp_path: Path) -> None:
    folder = _split(tmp_path, 12)
    assert container_of(folder) == "rosbag2"
    log = open_message_log(folder, salvage=False)
    _check(log, some_messages(48))
    assert len(log.channels) == 2 and any("no metadata.yaml" in note for note in log.notes)
    log.close()


def test_bag2_parts_are_in_the_order_that_metadata_names(tmp_path: Path) -> None:
    folder = _split(tmp_path, 3)
    names = "\n".join(f"    - split/bag_{index}.db3" for index in (2, 0, 1))  # older bags name the folder too
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 3\n  relative_file_paths:\n{names}\n  message_count: 12\n"
    )
    order = [index for part in (2, 0, 1) for index in range(part * 4, part * 4 + 4)]
    log = open_message_log(folder, salvage=False)
    assert read_messages(log) == [some_messages(12)[index] for index in order]
    log.close()


def test_single_files_of_a_bag2(tmp_path: Path) -> None:
    for mode, suffix in ((CompressionMode.NONE, ".db3"), (CompressionMode.FILE, ".db3.zstd")):
        path = write_bag2(tmp_path / mode.name, some_messages(), mode=mode) / f"{mode.name}{suffix}"
        assert container_of(path) == "rosbag2"
        log = open_message_log(path, salvage=False)
        _check(log, some_messages())
        log.close()


def test_bag2_of_old_versions_without_definitions(tmp_path: Path) -> None:
    path = write_bag2(tmp_path / "bag", some_messages()) / "bag.db3"
    with sqlite3.connect(path) as database:
        for table in ("message_definitions", "schema", "metadata"):
            database.execute(f"DROP TABLE {table}")
    log = open_message_log(path, salvage=False)
    assert read_messages(log) == some_messages()
    assert log.channels[0].schema_encoding == "" and log.channels[0].schema == b""


@pytest.mark.parametrize("journal", ["WAL", "PERSIST"])
def test_bag2_with_a_journal_of_a_recorder_that_was_killed(tmp_path: Path, journal: str) -> None:
    """What stands in the write-ahead log counts; what a rollback journal takes back does not."""
    path = write_bag2(tmp_path / "bag", some_messages()) / "bag.db3"
    database = sqlite3.connect(path, isolation_level=None)
    database.execute(f"PRAGMA journal_mode={journal}")
    database.execute("PRAGMA cache_size=1")
    database.execute("BEGIN")
    more = [("/a", 5_000_000_000 + index, bytes([index]) * 5000) for index in range(20)]
    for _, time, data in more:
        database.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (2, ?, ?)", (time, data))
    if journal == "WAL":
        database.execute("COMMIT")
    killed = tmp_path / "killed"
    shutil.copytree(tmp_path / "bag", killed)
    database.close()
    before = {file.name: file.read_bytes() for file in killed.iterdir()}
    log = open_message_log(killed / "bag.db3", salvage=False)
    assert read_messages(log) == some_messages() + (more if journal == "WAL" else [])
    assert any("journal was taken in" in note for note in log.notes)
    log.close()
    assert {file.name: file.read_bytes() for file in killed.iterdir()} == before


def test_what_is_no_container(tmp_path: Path) -> None:
    assert container_of(tmp_path / "missing") is None
    assert container_of(tmp_path) is None
    (tmp_path / "words.mcap").write_bytes(b"words")
    assert container_of(tmp_path / "words.mcap") is None and container_of(tmp_path) is None
    write_mcap(tmp_path / "log.mcap", some_messages(3))
    assert container_of(tmp_path) == "rosbag2"
    (tmp_path / "images").mkdir()
    assert container_of(tmp_path) is None
    with pytest.raises(BadInput, match="there is no such log"):
        open_message_log(tmp_path / "missing", salvage=True)
    with pytest.raises(BadInput, match="is not an MCAP file"):
        open_message_log(tmp_path / "words.mcap", salvage=True)
    with pytest.raises(BadInput, match="neither MCAP nor a ROS bag"):
        open_message_log(tmp_path / "images", salvage=True)


@pytest.mark.parametrize("container", ["mcap", "rosbag1", "rosbag2"])
def test_memory_stays_flat_on_a_long_log(tmp_path: Path, container: str) -> None:
    """10,000 messages of 20 kB: reading and fetching hold a few chunks of the 200 MB, and lean tables."""
    payload = random.Random(0).randbytes(20_000)
    messages = ((f"/{index % 4}", 1000 + index, index.to_bytes(4, "little") + payload) for index in range(10_000))
    path = tmp_path / "log"
    if container == "mcap":
        write_mcap(path, messages, chunk_size=1 << 20, compression=CompressionType.LZ4)  # type: ignore[arg-type]
    elif container == "rosbag1":
        write_bag1(path, messages, chunk_size=1 << 20)  # type: ignore[arg-type]
    else:
        path = write_bag2(path, messages) / "log.db3"  # type: ignore[arg-type]
    tracemalloc.start()
    try:
        log = open_message_log(path, salvage=True)
        places = [message.location for message in log.messages()]
        for place in places[::500]:
            log.fetch(place)
        log.close()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(places) == 10_000 and log.damage == []
    assert peak < 16e6


REAL = ["custom-camera-model.mcap", "example.mcap", "example_logs.mcap", "rosbag2/convert_b/rewriter_b_0.mcap"]


@pytest.mark.parametrize("name", REAL)
def test_real_mcap_beside_the_mcap_package(name: str) -> None:
    path = real_data("logs") / name
    log = open_message_log(path, salvage=False)
    with path.open("rb") as file:
        expected = [(c.topic, m.log_time, m.data) for _, c, m in make_reader(file).iter_messages(log_time_order=False)]
    assert read_messages(log) == expected and log.damage == []


@pytest.mark.parametrize(
    "name", ["example.bag", "example-bz2.bag", "example-lz4.bag", "watercan.bag", "single_depth_color_640x480.bag"]
)
def test_real_bags_beside_the_rosbags_package(name: str) -> None:
    path = real_data("logs") / name
    log = open_message_log(path, salvage=False)
    with Bag1Reader(path) as reader:
        expected = [(c.topic, time, bytes(data)) for c, time, data in reader.messages()]
    assert sorted(read_messages(log)) == sorted(expected) and log.damage == []


def test_real_bag_without_messages() -> None:
    log = open_message_log(real_data("logs") / "no-messages.bag", salvage=False)
    assert read_messages(log) == [] and log.channels == ()


@pytest.mark.parametrize(("name", "count"), [("convert_a", 150), ("convert_b", 75), ("talker", 20), ("wbag", 6074)])
def test_real_rosbag2_folders(name: str, count: int) -> None:
    log = open_message_log(real_data("logs") / "rosbag2" / name, salvage=False)
    assert len(read_messages(log)) == count == sum(channel.count or 0 for channel in log.channels)
    assert log.damage == []


def test_real_rosbag2_without_metadata() -> None:
    log = open_message_log(real_data("logs") / "rosbag2" / "reindex_test_bags" / "multiple_files", salvage=False)
    times = [time for _, time, _ in read_messages(log)]
    assert len(times) == 3177 and times == sorted(times)

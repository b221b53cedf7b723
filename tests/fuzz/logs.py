"""Harnesses of message logs: containers, decoders, images, whole rooms."""

from __future__ import annotations

import contextlib
import functools
import itertools
import shutil
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from rosbags.rosbag2 import StoragePlugin
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.messages.compressed_depth import decode_compressed_depth
from scenewright.stages.ingest.messages.container import Channel
from scenewright.stages.ingest.messages.decoding import decoder_for, why_unreadable
from scenewright.stages.ingest.messages.opening import open_message_log
from scenewright.stages.ingest.messages.pixels import (
    color_pixels,
    depth_pixels,
    depth_unit,
    label_pixels,
    role_of,
    why_other,
)
from scenewright.stages.ingest.messages.records import ImageRecord, Record, Undecodable
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter

from tests.fuzz.harness import Harness, as_file, chosen, edited, refused, scratch, script
from tests.unit.ingest.container_logs import some_messages, write_bag1, write_bag2, write_mcap
from tests.unit.ingest.message_logs import FIRST, SECOND, record_room, recorder
from tests.unit.ingest.ros_writing import ROS1, ROS2, definition
from tests.unit.ingest.rvl_writing import compressed_depth
from tests.unit.ingest.sample_messages import check_record, foxglove_messages, ros_messages
from tests.unit.ingest.tiny_room import CAMERA, frames, jpeg, png

DIALECTS = ("ros1", "ros2-mcap", "foxglove-protobuf", "foxglove-json")
MOST_MESSAGES = 100
SMALL = np.arange(48, dtype=np.uint16).reshape(6, 8) * 900


def _read_container(path: Path) -> None:
    """Read a log to its end, whole and salvaging; fetch its first messages again."""
    for salvage in (True, False):
        with refused(BadInput):
            log = open_message_log(path, salvage=salvage)
            try:
                for message in itertools.islice(log.messages(), MOST_MESSAGES):
                    with refused(BadInput):
                        assert log.fetch(message.location).data == message.data
            finally:
                log.close()


def mcap(data: bytes) -> None:
    """Any bytes as an MCAP file."""
    _read_container(as_file("log.mcap", data))


def rosbag1(data: bytes) -> None:
    """Any bytes as a ROS 1 bag."""
    _read_container(as_file("log.bag", data))


def rosbag2(data: bytes) -> None:
    """Any bytes as the one part of a ROS 2 bag."""
    _read_container(as_file("log_0.db3", data))


@functools.cache
def _whole_bag2() -> Path:
    return write_bag2(scratch() / "bag2", some_messages(4, 20))


@functools.cache
def _bag2_metadata() -> bytes:
    return (_whole_bag2() / "metadata.yaml").read_bytes()


def rosbag2_metadata(data: bytes) -> None:
    """Any bytes as the metadata.yaml of a whole ROS 2 bag."""
    folder = _whole_bag2()
    _bag2_metadata()  # kept before it is written over
    (folder / "metadata.yaml").write_bytes(data)
    _read_container(folder)


def _container_seeds() -> dict[str, dict[str, bytes]]:
    messages = some_messages(5, 20)
    folder = scratch() / "seeds"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    plain = {"enable_crcs": False, "chunk_size": 100}
    seeds: dict[str, dict[str, bytes]] = {"mcap": {}, "rosbag1": {}, "rosbag2": {}}
    for name, kind in (("none", CompressionType.NONE), ("lz4", CompressionType.LZ4), ("zstd", CompressionType.ZSTD)):
        path = write_mcap(folder / f"{name}.mcap", messages, compression=kind, **plain)
        seeds["mcap"][name] = path.read_bytes()
    path = write_mcap(folder / "crc.mcap", messages, compression=CompressionType.NONE, use_chunking=False)
    seeds["mcap"]["no chunks"] = path.read_bytes()
    for packing in ("none", "bz2", "lz4"):
        path = write_bag1(folder / f"{packing}.bag", messages, packing=packing, chunk_size=100)
        seeds["rosbag1"][packing] = path.read_bytes()
    bag = write_bag2(folder / "sqlite", messages[:2])
    seeds["rosbag2"]["sqlite"] = next(bag.glob("*.db3")).read_bytes()
    mcap_bag = write_bag2(folder / "mcap", messages[:2], storage=StoragePlugin.MCAP)
    seeds["rosbag2_metadata"] = {"metadata": _bag2_metadata(), "of mcap": (mcap_bag / "metadata.yaml").read_bytes()}
    return seeds


def frames_mcap(data: bytes) -> None:
    """Any bytes as the frames of a sequence."""
    with refused(BadInput), FrameReader(as_file("frames.mcap", data)) as reader:
        reader.poses()
        for index in range(min(3, len(reader))):
            with refused(BadInput):
                reader.read(index)


def _frames_seeds() -> dict[str, bytes]:
    small = CAMERA.model_copy(update={"width": 8, "height": 6, "cx": 4.0, "cy": 3.0})
    path = scratch() / "frames-seed.mcap"
    with FrameWriter(path, small) as writer:
        for index in range(2):
            color = np.full((6, 8, 3), 40 * index, np.uint8)
            writer.write(0.1 * index, color=color, depth=SMALL, world_from_camera=np.eye(4))
    return {"two frames": path.read_bytes()}


@functools.cache
def samples() -> tuple[tuple[Channel, bytes], ...]:
    """Return small messages of every type and dialect with their channels."""
    found: list[tuple[Channel, bytes]] = []
    color = np.full((6, 8, 3), 90, np.uint8)
    for dialect in DIALECTS:
        folder = scratch() / f"samples-{dialect}"
        shutil.rmtree(folder, ignore_errors=True)
        with recorder(folder, dialect) as log:
            log.image("/camera/color/image_raw", FIRST, color, "rgb8", "optical")
            log.image("/camera/depth/image_raw", FIRST, SMALL, "16UC1", "optical")
            log.compressed("/camera/color/image_raw/compressed", FIRST, jpeg(color), "jpeg", "optical")
            log.info("/camera/depth/camera_info", FIRST, "optical")
            log.transform("/tf", FIRST, "map", "optical", np.eye(4))
            log.odometry("/odom", FIRST, "odom", "base", np.eye(4))
            path = log.path
        opened = open_message_log(path, salvage=False)
        seen = set()
        for message in opened.messages():
            if message.channel.topic not in seen:
                seen.add(message.channel.topic)
                found.append((message.channel, message.data))
        opened.close()
    return (*found, *ros_messages(), *foxglove_messages())


def _read_image(record: ImageRecord, topic: str) -> None:
    assert role_of(record, topic) in ("color", "depth", "labels", "other")
    why_other(record, topic)
    assert depth_unit(record) in (1, 1000)
    for read in (color_pixels, depth_pixels, label_pixels):
        with refused(Undecodable, Unusable):
            image = read(record)
            assert isinstance(image, bytes) or (image.ndim in (2, 3) and image.size > 0)


def message(data: bytes) -> None:
    """The first byte chooses the type and dialect of the message that follows."""
    number, rest = chosen(data, len(samples()))
    channel = samples()[number][0]
    decode = decoder_for(channel)
    assert decode is not None, why_unreadable(channel)
    records: tuple[Record, ...] = ()
    with refused(Undecodable):
        try:
            records = decode(rest)
        except Undecodable as error:
            records = error.records
            raise
    for record in records:
        check_record(record)
        if isinstance(record, ImageRecord):
            _read_image(record, channel.topic)


def _message_seeds() -> dict[str, bytes]:
    return {
        f"{number:02d} {channel.message_encoding} {channel.type_name.replace('/', '.')}": bytes([number]) + data
        for number, (channel, data) in enumerate(samples())
    }


ENCODINGS = (("ros1", "ros1msg"), ("cdr", "ros2msg"), ("cdr", "ros2idl"))
TYPES = (
    "sensor_msgs/msg/Image",
    "geometry_msgs/msg/PoseStamped",
    "sensor_msgs/msg/CameraInfo",
    "tf2_msgs/msg/TFMessage",
)


def ros_definition(data: bytes) -> None:
    """Any bytes as the definition that a log embeds, and zeros as its message."""
    number, rest = chosen(data, len(ENCODINGS) * len(TYPES))
    (encoding, schema), name = ENCODINGS[number // len(TYPES)], TYPES[number % len(TYPES)]
    channel = Channel(1, "/topic", name if encoding == "cdr" else name.replace("/msg", ""), encoding, schema, rest)
    decode = decoder_for(channel)
    with refused(Undecodable):
        if decode is None:
            raise Undecodable(why_unreadable(channel))
    for message_bytes in (bytes(400), b"\0\1\0\0" + bytes(60), b"\xff" * 100):
        if decode is not None:
            with contextlib.suppress(Undecodable):
                decode(message_bytes)


def _definition_seeds() -> dict[str, bytes]:
    seeds = {}
    for number, name in enumerate(TYPES):
        short = name.replace("/msg", "")
        seeds[f"ros1 {short.replace('/', '.')}"] = bytes([number]) + definition(ROS1, short).encode()
        seeds[f"ros2 {short.replace('/', '.')}"] = bytes([number + len(TYPES)]) + definition(ROS2, short).encode()
    seeds["idl"] = bytes([2 * len(TYPES)]) + (
        b"module sensor_msgs { module msg { struct Image { unsigned long height; sequence<octet> data; }; }; };"
    )
    return seeds


DEPTH_ENCODINGS = (
    "16UC1; compressedDepth png",
    "32FC1; compressedDepth png",
    "16UC1; compressedDepth rvl",
    "32FC1; compressedDepth rvl",
    "16UC1; compressedDepth",
    "compressedDepth",
)


def compressed_depth_image(data: bytes) -> None:
    """The first byte chooses the encoding of the compressed depth that follows."""
    number, rest = chosen(data, len(DEPTH_ENCODINGS))
    with refused(Undecodable, Unusable):
        image = decode_compressed_depth(DEPTH_ENCODINGS[number], rest)
        assert image.ndim == 2


def _compressed_depth_seeds() -> dict[str, bytes]:
    metres = (SMALL / 1000).astype(np.float32) + 0.5
    return {
        "png": b"\0" + compressed_depth(SMALL, "png"),
        "rvl": b"\2" + compressed_depth(SMALL, "rvl"),
        "float png": b"\1" + compressed_depth(metres, "png"),
        "float rvl": b"\3" + compressed_depth(metres, "rvl"),
    }


IMAGE_ENCODINGS = (
    ("rgb8", 3),
    ("bgr8", 3),
    ("rgba8", 4),
    ("mono8", 1),
    ("mono16", 2),
    ("16UC1", 2),
    ("32FC1", 4),
    ("8UC3", 3),
    ("yuv422", 2),
    ("yuv422_yuy2", 2),
    ("bayer_rggb8", 1),
    ("nv12", 1),
    ("nonsense", 1),
)


def image_message(data: bytes) -> None:
    """Bytes as pixels: which encoding, compressed or not, width, height, step, byte order, then the data."""
    head, rest = data[:6].ljust(6, b"\0"), data[6:]
    encoding = IMAGE_ENCODINGS[head[0] % len(IMAGE_ENCODINGS)][0]
    compressed = bool(head[1] & 1)
    formats = (
        "jpeg",
        "png",
        "rgb8; jpeg compressed bgr8",
        "16UC1; png compressed",
        "webp",
        "16UC1; compressedDepth png",
    )
    record = ImageRecord(
        FIRST,
        "optical",
        formats[head[0] % len(formats)] if compressed else encoding,
        compressed,
        0 if compressed else head[2],
        0 if compressed else head[3],
        head[4] * (256 if head[1] & 4 else 1),
        bool(head[1] & 2),
        rest,
    )
    for topic in ("/camera/color/image_raw", "/camera/depth/image_raw", "/labels"):
        _read_image(record, topic)


def _image_seeds() -> dict[str, bytes]:
    seeds = {}
    for number, (encoding, size) in enumerate(IMAGE_ENCODINGS):
        seeds[encoding] = (
            bytes([number, 0, 8, 6, 8 * size, 0]) + bytes(range(240))[: 72 if encoding == "nv12" else 48 * min(size, 5)]
        )
    color = np.full((6, 8, 3), 90, np.uint8)
    seeds["jpeg"] = bytes([0, 1, 0, 0, 0, 0]) + jpeg(color)
    seeds["png"] = bytes([1, 1, 0, 0, 0, 0]) + png(color)
    seeds["depth png"] = bytes([3, 1, 0, 0, 0, 0]) + png(SMALL)
    return seeds


@functools.cache
def _room(dialect: str) -> Path:
    folder = scratch() / f"room-{dialect}"
    shutil.rmtree(folder, ignore_errors=True)
    with recorder(folder, dialect) as log:
        record_room(log, frames(2))
        return log.path


@functools.cache
def _room_file(dialect: str) -> tuple[Path, bytes]:
    path = _room(dialect)
    file = next(part for part in sorted(path.iterdir()) if part.suffix in (".db3", ".mcap")) if path.is_dir() else path
    return file, file.read_bytes()


def _edited_room(dialect: str):  # type: ignore[no-untyped-def]
    def target(data: bytes) -> None:
        """A log of a room with some of its bytes changed by an edit script: opened, and its frames loaded."""
        file, whole = _room_file(dialect)
        file.write_bytes(edited(whole, data))
        with refused(BadInput, UsageError):
            source = open_log(_room(dialect), IngestParameters())
            try:
                for entry in source.entries[:3]:
                    with refused(Unusable):
                        entry.load()
            finally:
                source.close()

    return target


def _script_seeds() -> dict[str, bytes]:
    return {
        "nothing": b"",
        "one byte": script((3000, 1, b"\xff")),
        "cut out": script((5000, 200, b"")),
        "three": script((900, 4, b"\xff\xff\xff\xff"), (2000, 0, b"abc"), (9000, 8, bytes(8))),
        "a number": script((1200, 8, SECOND.to_bytes(8, "little"))),
    }


HARNESSES = {
    "mcap": Harness(mcap, lambda: _container_seeds()["mcap"]),
    "rosbag1": Harness(rosbag1, lambda: _container_seeds()["rosbag1"]),
    "rosbag2": Harness(rosbag2, lambda: _container_seeds()["rosbag2"], largest=65536),
    "rosbag2_metadata": Harness(rosbag2_metadata, lambda: _container_seeds()["rosbag2_metadata"]),
    "frames_mcap": Harness(frames_mcap, _frames_seeds),
    "message": Harness(message, _message_seeds, choosing=1),
    "ros_definition": Harness(ros_definition, _definition_seeds, choosing=1),
    "compressed_depth": Harness(compressed_depth_image, _compressed_depth_seeds, choosing=1),
    "image_message": Harness(image_message, _image_seeds, choosing=6),
    "room_mcap": Harness(_edited_room("foxglove-protobuf"), _script_seeds),
    "room_rosbag1": Harness(_edited_room("ros1"), _script_seeds),
    "room_rosbag2": Harness(_edited_room("ros2-mcap"), _script_seeds),
}

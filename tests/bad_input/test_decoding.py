"""Messages and definitions made to break decoders: a record, or the reason why not. Nothing else, in bounded memory."""

from __future__ import annotations

import json
import struct
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.stages.ingest.messages.container import Channel
from scenewright.stages.ingest.messages.decoding import decoder_for, why_unreadable
from scenewright.stages.ingest.messages.pixels import (
    color_pixels,
    depth_pixels,
    depth_unit,
    label_pixels,
    role_of,
    why_other,
)
from scenewright.stages.ingest.messages.records import (
    CalibrationRecord,
    ImageRecord,
    ImuRecord,
    PointsRecord,
    PoseRecord,
    Record,
    TransformRecord,
    Undecodable,
)
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.geometry.transforms import is_rigid

from tests.unit.ingest.ros_writing import ROS1, ROS2, channel, header, serialized, xyz
from tests.unit.ingest.rvl_writing import compressed_depth
from tests.unit.ingest.test_decoding_definitions import IDL
from tests.unit.ingest.test_decoding_foxglove import CASES, LINE, _as_json

STAMP = 1_700_000_000_000_000_001
POSE = {"position": xyz((1, 2, 3)), "orientation": xyz((0, 0, 0.6, 0.8))}
TRANSFORM = {"translation": xyz((1, 2, 3)), "rotation": xyz((0, 0, 0.6, 0.8))}


def _ros_messages() -> list[tuple[Channel, bytes]]:
    found = []
    for store in (ROS1, ROS2):
        head = header(store, STAMP, "camera")
        edge = {"header": head, "child_frame_id": "c", "transform": TRANSFORM}
        image = {"height": 2, "width": 3, "encoding": "mono8", "step": 3, "data": np.arange(6, dtype=np.uint8)}
        messages: dict[str, dict[str, Any]] = {
            "sensor_msgs/Image": image,
            "sensor_msgs/CompressedImage": {"format": "png", "data": np.arange(9, dtype=np.uint8)},
            "sensor_msgs/CameraInfo": {"height": 2, "width": 3, "d": [0.1] * 5, "k": [1.0] * 9},
            "sensor_msgs/Imu": {"linear_acceleration": xyz((0, 0, 9.8))},
            "sensor_msgs/PointCloud2": {"fields": [{"name": "x", "count": 1}], "data": np.zeros(4, np.uint8)},
            "geometry_msgs/PoseStamped": {"pose": POSE},
            "nav_msgs/Odometry": {"child_frame_id": "base", "pose": {"pose": POSE}},
        }
        found += [(channel(store, n), serialized(store, n, header=head, **fields)) for n, fields in messages.items()]
        found.append(
            (channel(store, "tf2_msgs/TFMessage"), serialized(store, "tf2_msgs/TFMessage", transforms=[edge] * 3))
        )
    return found


def _foxglove_messages() -> list[tuple[Channel, bytes]]:
    found = []
    for name, (kind, fields) in CASES.items():
        found.append(
            (Channel(1, "/t", f"foxglove.{name}", "protobuf", "protobuf", b""), kind(**fields).SerializeToString())
        )
        found.append((Channel(1, "/t", f"foxglove.{name}", "json", "", b""), _as_json(name, {"sec": 1, "nsec": 2})))
    return found


VALID = _ros_messages() + _foxglove_messages()


def _check(record: Record) -> None:
    """A record that comes out of a decoder holds what its description promises."""
    assert 0 <= record.stamp < 2**63
    if isinstance(record, TransformRecord | PoseRecord):
        assert record.parent_from_child.shape == (4, 4) and is_rigid(record.parent_from_child)
    elif isinstance(record, ImuRecord):
        assert record.acceleration.shape == (3,) and np.isfinite(record.acceleration).all()
    elif isinstance(record, CalibrationRecord):
        assert (len(record.K), len(record.R) in (0, 9), len(record.P) in (0, 12)) == (9, True, True)
        assert np.isfinite([*record.D, *record.K, *record.R, *record.P]).all()
    elif isinstance(record, ImageRecord):
        assert isinstance(record.data, bytes) and min(record.width, record.height, record.step) >= 0
    else:
        assert isinstance(record, PointsRecord)


def _decode(decoder: Callable[[bytes], tuple[Record, ...]], data: bytes) -> None:
    try:
        records = decoder(data)
    except Undecodable as error:
        assert str(error) and len(str(error)) < 1000
        records = error.records
    for record in records:
        _check(record)


def _damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(["flip", "fill", "number", "cut", "insert"]))
        place = draw(st.integers(0, max(0, len(data) - 1)))
        if kind == "flip" and data:
            data[place] ^= 1 << draw(st.integers(0, 7))
        elif kind == "fill":
            data[place : place + 8] = b"\xff" * len(data[place : place + 8])
        elif kind == "number":
            number = draw(st.sampled_from([0, 1, 2**31 - 1, 2**31, 2**32 - 1, 1 << 20]))
            data[place : place + 4] = struct.pack("<I", number)[: len(data[place : place + 4])]
        elif kind == "cut":
            del data[place:]
        else:
            data[place:place] = draw(st.binary(max_size=9))
    return bytes(data)


@pytest.mark.parametrize("index", range(len(VALID)), ids=[f"{c.type_name}-{c.message_encoding}" for c, _ in VALID])
def test_any_bytes_and_any_damage_decode_or_say_why_not(index: int) -> None:
    where, whole = VALID[index]
    decoder = decoder_for(where)
    assert decoder is not None, why_unreadable(where)
    assert decoder(whole)

    @settings(max_examples=40, deadline=None)
    @given(st.data())
    def run(data: st.DataObject) -> None:
        _decode(decoder, _damaged(data.draw, whole))
        _decode(decoder, data.draw(st.binary(max_size=300)))

    run()
    for cut in range(len(whole)):
        _decode(decoder, whole[:cut])


def test_reasons_hold_no_values_so_that_messages_can_be_counted_by_them() -> None:
    """However many ways there are to break a message, there are few reasons."""
    random = np.random.default_rng(1)
    for where, whole in VALID:
        decoder, reasons = decoder_for(where), set()
        assert decoder is not None
        for _ in range(100):
            data = bytearray(whole)
            for place in random.integers(0, len(data), 3):
                data[place] = random.integers(256)
            try:
                decoder(bytes(data))
            except Undecodable as error:
                reasons.add(str(error))
        assert len(reasons) < 30, (where.type_name, reasons)


def test_every_truncation_of_a_ros_message_is_noticed() -> None:
    for where, whole in _ros_messages():
        decoder = decoder_for(where)
        assert decoder is not None
        for cut in range(len(whole)):
            with pytest.raises(Undecodable):
                decoder(whole[:cut])


# --- memory and time ---------------------------------------------------------------------------------------------

MEGABYTE = 1 << 20


def _peak(work: Callable[[], object]) -> tuple[int, float]:
    """Return (bytes, seconds of this process) that some work took at most."""
    tracemalloc.start()
    start = time.process_time()
    try:
        work()
        return tracemalloc.get_traced_memory()[1], time.process_time() - start
    finally:
        tracemalloc.stop()


def _ros2_decoder(type_name: str, schema: str) -> Callable[[bytes], tuple[Record, ...]] | None:
    return decoder_for(Channel(1, "/t", type_name, "cdr", "ros2msg", schema.encode()))


NESTED = "".join(
    "".join(f"Level{level + 1} a{i}\n" for i in range(30)) + f"{LINE}\nMSG: tf2_msgs/Level{level + 1}\n"
    for level in range(15)
)
HEAD = b"\0\1\0\0"
BOMBS: dict[str, tuple[str, bytes]] = {
    "transforms without end": ("geometry_msgs/TransformStamped[] transforms", HEAD + b"\xff" * 200_000),
    "as many as claimed, all empty": (f"None[] transforms\n{LINE}\nMSG: tf2_msgs/None", HEAD + b"\xff" * 4),
    "fixed array of empty messages": (f"None[4294967295] x\n{LINE}\nMSG: tf2_msgs/None", HEAD + bytes(9_000_000)),
    "fixed array of numbers": ("float64[9999999999] x", HEAD + bytes(100)),
    "texts without end": ("string[] transforms", HEAD + b"\xff\xff\xff\x7f" + bytes(2_000_000)),
    "text longer than the message": ("string transforms", HEAD + b"\xff\xff\xff\xff" + bytes(100)),
    "thirty messages within each of thirty, fifteen deep": (NESTED, HEAD + bytes(100_000)),
}


@pytest.mark.parametrize("name", sorted(BOMBS))
def test_claims_do_not_cost_memory_or_time(name: str) -> None:
    schema, data = BOMBS[name]

    def work() -> None:
        decoder = _ros2_decoder("tf2_msgs/TFMessage", schema)
        if decoder is not None:
            with pytest.raises(Undecodable):
                decoder(data)

    peak, seconds = _peak(work)
    assert peak < 300 * MEGABYTE and seconds < 15


def test_a_large_json_message_costs_a_bounded_multiple_of_its_size() -> None:
    data = b"[" + b"[]," * 200_000 + b"[]]"
    decoder = decoder_for(Channel(1, "/t", "foxglove.RawImage", "json", "", b""))
    assert decoder is not None
    with pytest.raises(Undecodable, match="no object"):
        decoder(data)
    peak, _ = _peak(lambda: pytest.raises(Undecodable, decoder, data))
    assert peak < 40 * len(data)


# --- definitions ---------------------------------------------------------------------------------------------------

MSG = (
    "std_msgs/Header header\nuint32 height\nPart[<=3] parts\nstring<=9 format\nuint8[] data\n"
    f"{LINE}\nMSG: sensor_msgs/Part\nfloat64[3] x\nint8 KIND=3\nstring[] names\n"
)
WORDS = [
    "struct",
    "module",
    "sequence<",
    ">",
    "{",
    "}",
    ";",
    "[",
    "]",
    "(",
    ")",
    "@",
    "const",
    "=",
    "<<",
    "::",
    "typedef",
    "Part",
    "x",
    "string",
    "float64",
    "Header",
    "MSG: a/B",
    LINE,
    "\n",
    "#",
    '"',
    "/*",
    "\0",
    "9" * 30,
    "a/b/c/d",
    "-1",
]


@settings(max_examples=150, deadline=None)
@given(st.data(), st.sampled_from(["ros2msg", "ros2idl", "ros1msg"]))
def test_any_definition_is_read_or_refused_in_words(data: st.DataObject, encoding: str) -> None:
    text = IDL if encoding == "ros2idl" else MSG
    for _ in range(data.draw(st.integers(0, 4))):
        place = data.draw(st.integers(0, len(text)))
        kind = data.draw(st.sampled_from(["insert", "cut", "remove", "noise"]))
        if kind == "insert":
            text = text[:place] + " " + data.draw(st.sampled_from(WORDS)) + " " + text[place:]
        elif kind == "cut":
            text = text[:place]
        elif kind == "remove":
            text = text[:place] + text[place + data.draw(st.integers(1, 30)) :]
        else:
            text = text[:place] + data.draw(st.text(max_size=8)) + text[place:]
    message_encoding = "ros1" if encoding == "ros1msg" else "cdr"
    type_name = "sensor_msgs/msg/CameraInfo" if encoding == "ros2idl" else "sensor_msgs/msg/CompressedImage"
    where = Channel(1, "/t", type_name, message_encoding, encoding, text.encode("utf-8", "replace"))
    decoder = decoder_for(where)
    if decoder is None:
        assert 0 < len(why_unreadable(where)) < 300
    else:
        _decode(decoder, data.draw(st.binary(max_size=200)))
        _decode(decoder, b"\0\1\0\0" + bytes(500))


@pytest.mark.parametrize(
    ("encoding", "text"),
    [
        ("ros2idl", "const long X = " + "(" * 200_000),
        ("ros2idl", "module a { " * 20_000),
        ("ros2idl", "module a { struct T { " + "sequence<" * 25_000),
        ("ros2idl", '"' * 250_000),
        ("ros2idl", "/*" * 120_000),
        ("ros2idl", "/* " * 80_000),
        ("ros2idl", '"' + '\\"' * 120_000),
        ("ros2idl", '"' + '\\"' * 120_000 + "\\"),
        ("ros2idl", "'" + "\\'" * 120_000 + "\\"),
        ("ros2idl", "=" * 250_000),
        ("ros2idl", ("=" * 20 + " ") * 12_000),
        ("ros2idl", "=" * 20 + " \n" * 120_000),
        ("ros2idl", "a" * 250_000 + "::"),
        ("ros2idl", "@a(" * 80_000),
        ("ros2idl", "a::" * 60_000),
        ("ros2msg", "a" * 250_000),
        ("ros2msg", "a/" * 120_000 + " x"),
        ("ros2msg", "uint8 x\n" * 30_000),
        ("ros2msg", f"{LINE}\nMSG: sensor_msgs/A\n" * 2_000),
        ("ros2msg", " " * 250_000),
        ("ros2msg", "uint8" + " " * 250_000 + "!"),
    ],
)
def test_definitions_are_read_in_linear_time(encoding: str, text: str) -> None:
    where = Channel(1, "/t", "sensor_msgs/msg/Image", "cdr", encoding, text.encode())
    peak, seconds = _peak(lambda: decoder_for(where))
    assert seconds < 20 and peak < 400 * MEGABYTE


def test_names_of_types_are_shown_short() -> None:
    where = Channel(1, "/t", "x" * 1_000_000, "cdr", "ros2msg", b"")
    assert decoder_for(where) is None and len(why_unreadable(where)) < 200


# --- pixels --------------------------------------------------------------------------------------------------------

READERS: list[Callable[[ImageRecord], Any]] = [color_pixels, depth_pixels, label_pixels]
ENCODINGS = [
    "rgb8",
    "bgr8",
    "rgba8",
    "mono8",
    "mono16",
    "16UC1",
    "32FC1",
    "rgb16",
    "bayer_rggb8",
    "bayer_gbrg8",
    "yuv422",
    "yuyv",
    "nv12",
    "nv21",
    "32SC1",
    "8UC4",
    "jpeg",
    "",
    "rgb8; jpeg compressed rgb8",
    "16UC1; compressedDepth png",
    "16UC1; compressedDepth rvl",
    "32FC1; compressedDepth rvl",
    "h264",
    "\0",
    "TYPE",
]
SIZES = st.one_of(st.integers(0, 9), st.sampled_from([2**16, 2**31, 2**32 - 1]))


def _look(record: ImageRecord) -> None:
    for topic in ("/camera/depth", "/camera/color", "/labels", "/x"):
        assert role_of(record, topic) in ("color", "depth", "labels", "other")
        why_other(record, topic)
    assert depth_unit(record) in (1, 1000)
    for read in READERS:
        try:
            image = read(record)
        except Unusable as error:
            assert error.reason and len(str(error)) < 400
        else:
            assert isinstance(image, bytes) or (image.ndim in (2, 3) and image.size > 0)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(ENCODINGS), st.booleans(), SIZES, SIZES, SIZES, st.booleans(), st.binary(max_size=400))
def test_any_image_has_pixels_or_a_reason(
    encoding: str, is_compressed: bool, width: int, height: int, step: int, big_endian: bool, data: bytes
) -> None:
    if is_compressed:
        width = height = step = 0
    _look(ImageRecord(1, "f", encoding, is_compressed, width, height, step, big_endian, data))


SMALL = np.random.default_rng(0).integers(1, 3000, (12, 17)).astype(np.uint16)
FILES = {
    "jpeg": cv2.imencode(".jpg", np.dstack([SMALL] * 3).astype(np.uint8))[1].tobytes(),
    "png": cv2.imencode(".png", SMALL)[1].tobytes(),
    "webp": cv2.imencode(".webp", np.dstack([SMALL] * 3).astype(np.uint8))[1].tobytes(),
    "16UC1; compressedDepth png": compressed_depth(SMALL, "png"),
    "16UC1; compressedDepth rvl": compressed_depth(SMALL, "rvl"),
    "32FC1; compressedDepth rvl": compressed_depth(SMALL.astype(np.float32) / 1000, "rvl"),
}


@settings(max_examples=200, deadline=None)
@given(st.data(), st.sampled_from(sorted(FILES)))
def test_any_damaged_picture_has_pixels_or_a_reason(data: st.DataObject, encoding: str) -> None:
    _look(ImageRecord(1, "f", encoding, True, 0, 0, 0, False, _damaged(data.draw, FILES[encoding])))


def test_sizes_are_checked_before_memory_is_taken() -> None:
    raw = ImageRecord(1, "f", "rgb8", False, 2**16, 2**16, 0, False, bytes(1000))
    rvl = ImageRecord(
        1, "f", "16UC1; compressedDepth rvl", True, 0, 0, 0, False, bytes(12) + struct.pack("<II", 2**20, 2**20)
    )
    for record in (raw, rvl):
        for read in READERS:
            peak, seconds = _peak(lambda read=read, record=record: pytest.raises(Unusable, read, record))
            assert peak < MEGABYTE and seconds < 1


def test_json_values_of_every_wrong_kind() -> None:
    """Each field of each type in turn replaced by something else."""
    for name in CASES:
        decoder = decoder_for(Channel(1, "/t", f"foxglove.{name}", "json", "", b""))
        assert decoder is not None
        whole = json.loads(_as_json(name, {"sec": 1, "nsec": 2}))
        for field in whole:
            for value in (None, True, -1, 1.5, "x", [], {}, [1], [None], [{}], {"x": "y"}, 10**400, "é" * 10):
                _decode(decoder, json.dumps(whole | {field: value}).encode())

"""Messages and definitions made to break decoders: a record, or the reason why not. Nothing else, in bounded memory."""

from __future__ import annotations

import json
import struct
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from scenewright.stages.ingest.messages.container import Channel
from scenewright.stages.ingest.messages.decoding import decoder_for, why_unreadable
from scenewright.stages.ingest.messages.json_messages import LARGEST_MESSAGE
from scenewright.stages.ingest.messages.pixels import color_pixels, depth_pixels, label_pixels
from scenewright.stages.ingest.messages.records import ImageRecord, Record, Undecodable
from scenewright.stages.ingest.source import Unusable

from tests.unit.ingest.sample_messages import check_record, foxglove_messages, ros_messages
from tests.unit.ingest.test_decoding_foxglove import CASES, LINE, _as_json

VALID = ros_messages() + foxglove_messages()


def _decode(decoder: Callable[[bytes], tuple[Record, ...]], data: bytes) -> None:
    try:
        records = decoder(data)
    except Undecodable as error:
        assert str(error) and len(str(error)) < 1000
        records = error.records
    for record in records:
        check_record(record)


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


# --- messages that cannot be -------------------------------------------------------------------------------------


def _raw_json(**changes: Any) -> bytes:
    return _as_json("RawImage", {"sec": 1, "nsec": 2}, **changes)


def _in_json(name: str) -> Channel:
    return Channel(1, "/t", f"foxglove.{name}", "json", "jsonschema", b"{}")


def _in_protobuf(name: str) -> Channel:
    return Channel(1, "/t", f"foxglove.{name}", "protobuf", "protobuf", b"")


BROKEN_JSON: list[tuple[bytes, str]] = [
    (b"", "no JSON"),
    (b"{", "no JSON"),
    (b"[]", "not an object"),
    (b"\xff\xfe", "no JSON"),
    (b"[" * 100_000, "no JSON"),
    (b'{"a":' * 100_000, "no JSON"),
    (b'{"width": NaN}', "NaN is not a number"),
    (b'{"width": -Infinity}', "-Infinity is not a number"),
    (b'{"width": ' + b"9" * 5000 + b"}", "no JSON"),
    (_raw_json(data="no base64!"), "not base64"),
    (_raw_json(data="AAA"), "not base64"),
    (_raw_json(data="Grüße"), "not base64"),
    (_raw_json(data=[1, 2, 3]), "not an array of bytes"),
    (_raw_json(width=-1), "'width' is not a size"),
    (_raw_json(width=1e300), "'width' is not a size"),
    (_raw_json(width=True), "'width' is not a size"),
    (_raw_json(height=2**32), "'height' is not a size"),
    (_raw_json(encoding=None), "'encoding' is not text"),
    (_raw_json(frame_id="x" * 5000), "more than 4096 characters"),
    (_raw_json(timestamp=5), "the stamp is not a pair"),
    (_raw_json(timestamp={"sec": 1.5, "nsec": 0}), "no whole number 'sec'"),
    (_raw_json(timestamp={"sec": 1}), "no whole number 'nsec'"),
    (b'{"timestamp": {"sec": 1, "nsec": 2}}', "no field 'frame_id'"),
    (bytes(LARGEST_MESSAGE + 1), "more than"),
]
BROKEN_CALIBRATIONS: list[tuple[dict[str, Any], str]] = [
    ({"K": [1.0] * 8}, "'k' has not as many"),
    ({"K": ["1"] * 9}, "'k' is not a number"),
    ({"K": [1e999] * 9}, "not finite|not a number"),
    ({"D": [0.0] * 300}, "'d' has not as many"),
    ({"D": 0.5}, "'d' is not a list"),
    ({"P": [1.0] * 9}, "'p' has not as many"),
    ({"D": [10**400]}, "not finite"),
]
UNDECODABLE: list[tuple[Channel, bytes, str]] = [
    *[(_in_json("RawImage"), data, reason) for data, reason in BROKEN_JSON],
    *[
        (_in_json("CameraCalibration"), _as_json("CameraCalibration", {"sec": 1, "nsec": 2}, **changes), reason)
        for changes, reason in BROKEN_CALIBRATIONS
    ],
    *[(_in_protobuf(name), b"\xff" * 20, f"no foxglove.{name} in protobuf") for name in CASES],
    (
        _in_protobuf("FrameTransform"),
        FrameTransform(parent_frame_id="a", child_frame_id="b").SerializeToString(),
        "no rigid transform|not a rigid transform",
    ),
    *[
        (
            _in_protobuf("PointCloud"),
            PointCloud(timestamp={"seconds": seconds, "nanos": nanos}).SerializeToString(),
            "the stamp is negative",
        )
        for seconds, nanos in ((-1, 0), (1, -1), (1, 10**9), (2**62, 0))
    ],
]
"""(channel, message, words of the refusal)."""


@pytest.mark.parametrize(("where", "data", "words"), UNDECODABLE, ids=[f"{c.type_name} {w}" for c, _, w in UNDECODABLE])
def test_undecodable(where: Channel, data: bytes, words: str) -> None:
    decoder = decoder_for(where)
    assert decoder is not None and why_unreadable(where) == ""
    with pytest.raises(Undecodable, match=words):
        decoder(data)


def test_every_truncation_of_a_ros_message_is_noticed() -> None:
    for where, whole in ros_messages():
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
    with pytest.raises(Undecodable, match="not an object"):
        decoder(data)
    peak, _ = _peak(lambda: pytest.raises(Undecodable, decoder, data))
    assert peak < 40 * len(data)


# --- definitions ---------------------------------------------------------------------------------------------------


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


def test_sizes_are_checked_before_memory_is_taken() -> None:
    raw = ImageRecord(1, "f", "rgb8", False, 2**16, 2**16, 0, False, bytes(1000))
    rvl = ImageRecord(
        1, "f", "16UC1; compressedDepth rvl", True, 0, 0, 0, False, bytes(12) + struct.pack("<II", 2**20, 2**20)
    )
    for record in (raw, rvl):
        for read in (color_pixels, depth_pixels, label_pixels):
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

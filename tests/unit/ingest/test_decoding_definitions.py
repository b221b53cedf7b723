"""Definitions and serialisation of ROS messages against rosbags and mcap-ros2-support, type by type."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import normalize_fieldname
from scenewright.stages.ingest.messages.ros_definitions import (
    SEQUENCE,
    UnreadableDefinition,
    bundled_definitions,
    definitions_of,
    parse_idl,
    parse_msg,
    short_name,
)
from scenewright.stages.ingest.messages.ros_serialization import RosReader

from tests.real_data import real_data
from tests.unit.ingest.ros_writing import ROS1, ROS2, definition, long_name, typestore

STRUCT_CODES = {
    "bool": "B",
    "byte": "B",
    "char": "B",
    "octet": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
    "string": "string",
}


def _as_rosbags_has_it(fields: Any) -> list[tuple[str, str, int | None]]:
    found: list[tuple[str, str, int | None]] = []
    for name, (node, detail) in fields:
        count: int | None = None
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (inner, detail), limit = detail
            count, node = (limit if node == Nodetype.ARRAY else SEQUENCE), inner
        kind = short_name(detail) if node == Nodetype.NAME else STRUCT_CODES.get(detail[0], detail[0])
        found.append((name.lower(), kind, count))
    return found


def _ours(fields: Any) -> list[tuple[str, str, int | None]]:
    return [(field.name, field.kind, field.count) for field in fields]


@pytest.mark.parametrize("store", [ROS1, ROS2])
def test_every_common_definition_reads_as_rosbags_reads_it(store: Stores) -> None:
    types = typestore(store)
    for name, (_, fields) in types.fielddefs.items():
        text = definition(store, name)
        parsed = parse_msg(text, name)
        for inner, (_, inner_fields) in get_types_from_msg(text, name).items():
            assert _ours(parsed[short_name(inner)]) == _as_rosbags_has_it(inner_fields), inner
        expected = [row for row in _as_rosbags_has_it(fields) if row[0] != "structure_needs_at_least_one_member"]
        bundled = bundled_definitions("ros1" if store == ROS1 else "ros2").get(short_name(name))
        if bundled is not None and store == ROS1 and not name.startswith("builtin_interfaces"):
            assert _ours(bundled) == expected
    assert len(types.fielddefs) > 140


IDL = """
// generated from rosidl_adapter
#include "std_msgs/msg/Header.idl"

module sensor_msgs {
  module msg {
    typedef double double__9[9];
    typedef sequence<octet, 16> few_bytes;
    module CameraInfo_Constants {
      const long KIND = 3;
      const string NAME = "a; } b";
    };
    @verbatim (language="comment", text=
      "struct Trap { long x; };" "\\n"
      "with \\"quotes\\" (and parentheses")
    struct CameraInfo {
      std_msgs::msg::Header header;
      @unit (value="pixel") @verbatim (language="comment", text="twice")
      uint32 height;
      unsigned long width;
      @default (value="none")
      string<20> distortion_model;
      sequence<double> d;
      double__9 k;
      few_bytes notes;
      sequence<sensor_msgs::msg::Region, 4> regions;
      Region here;
      long long first, second[2];
      float gain; boolean on; char letter; octet raw; short s; unsigned short us; unsigned long long big;
      int8 small_one; uint64 big_one;
    };
    enum Mode { OFF, ON };
    struct Region { long x; /* and */ long y; };
  };
};
"""


def test_idl_reads_as_its_msg() -> None:
    msg = (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring<=20 distortion_model\nfloat64[] d\nfloat64[9] k\n"
        "byte[<=16] notes\nRegion[<=4] regions\nRegion here\nint64 first\nint64[2] second\nfloat32 gain\nbool on\n"
        "char letter\nbyte raw\nint16 s\nuint16 us\nuint64 big\nint8 small_one\nuint64 big_one\n"
        "===========================\nMSG: sensor_msgs/Region\nint32 x\nint32 y"
    )
    header = "=" * 80 + "\nIDL: sensor_msgs/msg/CameraInfo\n"
    assert parse_idl(header + IDL) == parse_msg(msg, "sensor_msgs/msg/CameraInfo")
    found = definitions_of("sensor_msgs::msg::CameraInfo", "omgidl", IDL.encode())
    assert found["sensor_msgs/CameraInfo"] == parse_idl(IDL)["sensor_msgs/CameraInfo"]
    assert _ours(found["std_msgs/Header"]) == [("stamp", "builtin_interfaces/Time", None), ("frame_id", "string", None)]


def test_idl_reads_as_rosbags_reads_it() -> None:
    text = """
    module a_msgs { module msg {
      struct Part { @key int32 x; string name; };
      typedef float float__4[4];
      struct Whole { a_msgs::msg::Part part; sequence<a_msgs::msg::Part> parts; float__4 row; sequence<string> names; };
    }; };"""
    ours = parse_idl(text)
    for name, (_, fields) in get_types_from_idl(text).items():
        assert _ours(ours[short_name(name)]) == _as_rosbags_has_it(fields)


@pytest.mark.parametrize(
    "text",
    [
        "module a { module msg { struct T { long x",
        "module a { module msg { struct T { sequence<sequence<long>> x; }; }; };",
        "module a { module msg { struct T { long x[2][3]; }; }; };",
        "module a { module msg { struct T { long x[1 << 90]; }; }; };",
        "module a { module msg { struct T { long x[WIDTH]; }; }; };",
        "module a { module msg { struct T { + x; }; }; };",
        "union U { long x; };",
        "@verbatim((((",
        "struct",
        "module a { module msg { struct T { long x; } };",
        "const long X = " + "(" * 100_000,
        "module a { " * 10_000,
    ],
)
def test_idl_that_is_not_understood(text: str) -> None:
    with pytest.raises(UnreadableDefinition):
        definitions_of("a/msg/T", "ros2idl", text.encode())


# --- any definition, any message ---------------------------------------------------------------------------------

PRIMITIVES = ["bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"]


@st.composite
def definitions(draw: st.DrawFn) -> tuple[str, dict[str, list[tuple[str, str, str]]]]:
    """Return concatenated `.msg` text of test_msgs/T0, and type -> (field, kind, brackets). T0 may hold T1, T1 T2."""
    types: dict[str, list[tuple[str, str, str]]] = {}
    depth = draw(st.integers(1, 3))
    for level in range(depth):
        inner = [f"test_msgs/T{level + 1}"] if level + 1 < depth else []
        kind = st.sampled_from([*PRIMITIVES, "string", *inner])
        brackets = st.sampled_from(["", "", "[]", "[3]", "[1]", "[<=5]"])
        rows = draw(st.lists(st.tuples(kind, brackets), min_size=0 if level else 1, max_size=6))
        types[f"test_msgs/T{level}"] = [(f"f{i}", kind, brackets) for i, (kind, brackets) in enumerate(rows)]
        if inner and not any(kind in inner for _, kind, _ in types[f"test_msgs/T{level}"]):
            types[f"test_msgs/T{level}"].append(("last", inner[0], draw(brackets)))
    texts = ["\n".join(f"{kind}{b} {name}" for name, kind, b in rows) + "\n" for rows in types.values()]
    heads = ["", *(f"{'=' * 80}\nMSG: {name}\n" for name in list(types)[1:])]
    return "".join(head + text for head, text in zip(heads, texts, strict=True)), types


def _values(draw: st.DrawFn, types: Any, registered: Any, name: str) -> Any:
    strategies = {
        "bool": st.booleans(),
        "string": st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
        "float32": st.floats(width=32),
        "float64": st.floats(),
    }
    fields = {}
    for field, kind, brackets in types[name]:
        if "/" in kind:
            one: Any = lambda kind=kind: _values(draw, types, registered, kind)  # noqa: E731
        else:
            bits = "".join(c for c in kind if c.isdigit())
            low, high = (0, 2 ** int(bits or 8) - 1) if kind.startswith("u") else (-(2 ** (int(bits or 8) - 1)), 0)
            strategy = strategies.get(kind, st.integers(low, high or 2 ** (int(bits or 8) - 1) - 1))
            one = lambda strategy=strategy: draw(strategy)  # noqa: E731
        if not brackets:
            fields[field] = one()
            continue
        count = int(brackets[1:-1]) if brackets[1:-1].isdigit() else draw(st.integers(0, 4))
        values = [one() for _ in range(count)]
        fields[field] = values if kind == "string" or "/" in kind else np.array(values, kind)
    if not fields:
        fields = {"structure_needs_at_least_one_member": 0}
    return registered.types[long_name(name)](**fields)


def _same(ours: Any, theirs: Any) -> bool:
    if hasattr(theirs, "__msgtype__"):
        names = {name.lower(): name for name in vars(theirs)}
        ours = {name: value for name, value in ours.items() if name != "structure_needs_at_least_one_member"}
        return all(_same(value, getattr(theirs, names[normalize_fieldname(name)])) for name, value in ours.items())
    if isinstance(theirs, np.ndarray):
        ours = np.asarray(ours)
        return ours.shape == theirs.shape and np.array_equal(ours, theirs, equal_nan=theirs.dtype.kind == "f")
    if isinstance(theirs, list):
        return len(ours) == len(theirs) and all(_same(a, b) for a, b in zip(ours, theirs, strict=True))
    return ours == theirs or (isinstance(theirs, float) and math.isnan(theirs) and math.isnan(ours))


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_any_message_reads_as_rosbags_wrote_it(data: st.DataObject) -> None:
    text, types = data.draw(definitions())
    registered = get_typestore(Stores.EMPTY)
    registered.register(get_types_from_msg(text, "test_msgs/msg/T0"))
    message = _values(data.draw, types, registered, "test_msgs/T0")
    parsed = definitions_of("test_msgs/msg/T0", "ros2msg", text.encode())
    for little_endian in (True, False):
        written = bytes(registered.serialize_cdr(message, "test_msgs/msg/T0", little_endian=little_endian))
        assert _same(RosReader("test_msgs/T0", parsed, aligned=True).read(written), message)
    written = bytes(registered.serialize_ros1(message, "test_msgs/msg/T0"))
    assert _same(RosReader("test_msgs/T0", parsed, aligned=False).read(written), message)


# --- real logs ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["single_depth_color_640x480.bag", "watercan.bag", "example.bag"])
def test_real_bags_read_as_rosbags_reads_them(name: str) -> None:
    types = get_typestore(Stores.EMPTY)
    for shared in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"):
        types.register({shared: typestore(ROS1).fielddefs[shared]})
    readers: dict[int, RosReader] = {}
    with Reader(real_data("logs") / name) as reader:
        for index, (connection, _, data) in enumerate(reader.messages()):
            if connection.id not in readers:
                types.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
                schema = connection.msgdef.data.encode()
                parsed = definitions_of(connection.msgtype, "ros1msg", schema)
                readers[connection.id] = RosReader(short_name(connection.msgtype), parsed, aligned=False)
            elif index % 5:
                continue
            ours = readers[connection.id].read(bytes(data))
            assert _same(ours, types.deserialize_ros1(data, connection.msgtype)), connection.topic


def test_real_rosbag2_messages_read_as_mcap_ros2_reads_them() -> None:
    files = sorted((real_data("logs") / "rosbag2").rglob("*.mcap"))
    assert len(files) > 5
    seen = {name for path in files for name in _compare_mcap(path)}
    assert {"std_msgs/msg/String", "rcl_interfaces/msg/Log", "test_msgs/msg/BasicTypes"} <= seen


def _compare_mcap(path: Path) -> set[str]:
    seen = set()
    with path.open("rb") as file:
        for index, (schema, channel, message) in enumerate(make_reader(file).iter_messages()):
            assert schema is not None
            if not schema.data or (schema.name in seen and index % 20):  # test_msgs/Empty has an empty definition
                continue
            seen.add(schema.name)
            theirs = DecoderFactory().decoder_for(channel.message_encoding, schema)
            assert theirs is not None
            parsed = definitions_of(schema.name, schema.encoding, schema.data)
            ours = RosReader(short_name(schema.name), parsed, aligned=True).read(message.data)
            assert _alike(ours, theirs(message.data)), (path.name, schema.name)
    return seen


def _alike(ours: Any, theirs: Any) -> bool:
    if isinstance(ours, dict):
        slots = {name.lower(): name for name in theirs.__slots__}
        return all(_alike(value, getattr(theirs, slots[name])) for name, value in ours.items() if name in slots)
    if isinstance(ours, list | np.ndarray | memoryview):
        return len(ours) == len(theirs) and all(_alike(a, b) for a, b in zip(ours, theirs, strict=True))
    return bool(ours == theirs)

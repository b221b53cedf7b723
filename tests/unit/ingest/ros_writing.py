"""Serialises ROS messages with the rosbags library, which the decoders under test do not use to read."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scenewright.stages.ingest.messages.container import Channel

ROS1, ROS2 = Stores.ROS1_NOETIC, Stores.ROS2_HUMBLE


@cache
def typestore(store: Stores) -> Any:
    types = get_typestore(store)
    if store == ROS1:
        types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    return types


def long_name(type_name: str) -> str:
    return type_name.replace("/", "/msg/") if "/msg/" not in type_name else type_name


def definition(store: Stores, type_name: str) -> str:
    return typestore(store).generate_msgdef(long_name(type_name), ros_version=1 if store == ROS1 else 2)[0]


def channel(store: Stores, type_name: str, topic: str = "/topic", schema: str | None = None) -> Channel:
    """Return the channel of a type with its definition embedded (`schema` overrides it)."""
    text = definition(store, type_name) if schema is None else schema
    if store == ROS1:
        return Channel(1, topic, type_name, "ros1", "ros1msg", text.encode())
    return Channel(1, topic, long_name(type_name), "cdr", "ros2msg", text.encode())


def serialized(store: Stores, type_name: str, *, little_endian: bool = True, **fields: Any) -> bytes:
    """Return a message; nested messages are given as dicts, lists of them as lists of dicts."""
    types = typestore(store)
    message = _built(types, long_name(type_name), fields)
    if store == ROS1:
        return bytes(types.serialize_ros1(message, long_name(type_name)))
    return bytes(types.serialize_cdr(message, long_name(type_name), little_endian=little_endian))


def _built(types: Any, type_name: str, fields: dict[str, Any]) -> Any:
    values = {}
    for name, (node, detail) in types.fielddefs[type_name][1]:
        given = fields.get(name, fields.get(name.lower()))
        if node == 1:
            values[name] = given if given is not None else ("" if detail[0] == "string" else 0)
        elif node == 2:
            values[name] = _built(types, detail, given or {})
        else:
            (inner, kind), count = detail
            if inner == 2:
                values[name] = [_built(types, kind, item) for item in given or []]
            elif kind[0] == "string":
                values[name] = list(given or [])
            else:
                dtype = {"byte": "uint8", "char": "uint8"}.get(kind[0], kind[0])
                values[name] = np.array(given if given is not None else np.zeros(count if node == 3 else 0), dtype)
    return types.types[type_name](**values)


def header(store: Stores, stamp: int, frame: str) -> dict[str, Any]:
    """Return the fields of a std_msgs/Header, `stamp` in [ns]."""
    fields: dict[str, Any] = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": frame}
    return fields | ({"seq": 7} if store == ROS1 else {})


def xyz(values: Any) -> dict[str, float]:
    return dict(zip("xyzw", (float(value) for value in values), strict=False))

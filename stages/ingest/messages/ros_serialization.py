"""Bytes of a ROS message -> its fields, by a definition: CDR (ROS 2, little or big endian) and ROS 1.

A message cannot make this read outside of its bytes, allocate more than a multiple of them, or run for long.
CDR: OMG DDSI-RTPS 2.2, section 10 (encapsulation), and CORBA 3 part 2, section 9.3 (alignment).
ROS 1: wiki.ros.org/msg, without any alignment.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from scenewright.stages.ingest.messages.records import Undecodable
from scenewright.stages.ingest.messages.ros_definitions import (
    EMPTY_STRUCT_MEMBER,
    SEQUENCE,
    TEXT,
    Definitions,
    Field,
    UnreadableDefinition,
)

MOST_VALUES = 250_000
"""Fields that one message may hold, an array of numbers counted as one."""
DEEPEST = 24
"""Levels of messages within messages."""
_ENCAPSULATION = 4
"""Bytes of the CDR encapsulation header (OMG DDSI-RTPS)."""
_PADDING = 8
"""Bytes that a CDR message may be longer than its fields: writers round up."""


@dataclass(frozen=True)
class _Scalars:
    """Neighbouring numbers that are read at once."""

    names: tuple[str, ...]
    packed: struct.Struct
    alignment: int


@dataclass(frozen=True)
class _Numbers:
    """An array of numbers. `count` may be SEQUENCE."""

    name: str
    dtype: np.dtype[Any]
    count: int


@dataclass(frozen=True)
class _Texts:
    """One text (count None) or an array of them."""

    name: str
    count: int | None


@dataclass(frozen=True)
class _Messages:
    """One message (count None) or an array of them."""

    name: str
    kind: str
    count: int | None


_Part = _Scalars | _Numbers | _Texts | _Messages


class RosReader:
    """Reads messages of one type. Raises UnreadableDefinition when the definitions cannot be read by."""

    def __init__(self, type_name: str, definitions: Definitions, *, aligned: bool) -> None:
        """`aligned`: CDR, else ROS 1."""
        _check_depth(type_name, definitions)
        self._type_name = type_name
        self._aligned = aligned
        self._plans = {order: _plan(definitions, order, aligned) for order in ("<>" if aligned else "<")}

    def read(self, data: bytes) -> dict[str, Any]:
        """Return the fields: numbers, texts, nested dicts and lists; arrays of numbers as views of `data`.

        Raises Undecodable.
        """
        view, order = memoryview(data), "<"
        if self._aligned:
            if len(view) < _ENCAPSULATION or view[0] != 0 or view[1] > 1:
                raise Undecodable("does not start with the mark of plain CDR")
            order = "<" if view[1] == 1 else ">"
            view = view[_ENCAPSULATION:]
        cursor = _Cursor(view, self._plans[order], order, self._aligned)
        fields = cursor.message(self._type_name)
        remaining = len(view) - cursor.position
        if remaining > (_PADDING if self._aligned else 0):
            raise Undecodable("bytes are left over: the message does not fit its definition")
        return fields


def _check_depth(type_name: str, definitions: Definitions) -> None:
    """Refuse types that contain themselves or are nested too deep. Each type is looked at once."""
    depths: dict[str, int] = {}

    def depth(name: str, above: int) -> int:
        if above > DEEPEST:
            raise UnreadableDefinition(f"its definition is nested more than {DEEPEST} deep, or contains itself")
        if name not in depths:
            inner = {field.kind for field in definitions[name] if "/" in field.kind}
            depths[name] = 1 + max((depth(kind, above + 1) for kind in sorted(inner)), default=0)
        return depths[name]

    if depth(type_name, 1) > DEEPEST:
        raise UnreadableDefinition(f"its definition is nested more than {DEEPEST} deep")


def _plan(definitions: Definitions, order: str, aligned: bool) -> dict[str, tuple[_Part, ...]]:
    return {name: tuple(_parts(fields, order, aligned)) for name, fields in definitions.items()}


def _parts(fields: tuple[Field, ...], order: str, aligned: bool) -> list[_Part]:
    parts: list[_Part] = []
    if aligned and not fields:
        fields = (Field(EMPTY_STRUCT_MEMBER, "B"),)
    run: list[Field] = []

    def end_run() -> None:
        if run:
            packed = struct.Struct(order + "".join(field.kind for field in run))
            alignment = struct.calcsize(run[0].kind) if aligned else 1
            parts.append(_Scalars(tuple(field.name for field in run), packed, alignment))
            run.clear()

    for field in fields:
        number = len(field.kind) == 1
        if number and field.count is None:
            if run and aligned and struct.calcsize(run[0].kind) != struct.calcsize(field.kind):
                end_run()
            run.append(field)
            continue
        end_run()
        if number:
            assert field.count is not None
            parts.append(_Numbers(field.name, np.dtype(order + field.kind), field.count))
        elif field.kind == TEXT:
            parts.append(_Texts(field.name, field.count))
        elif "/" in field.kind:
            parts.append(_Messages(field.name, field.kind, field.count))
        else:
            raise UnreadableDefinition(f"field {field.name!r} is of type {field.kind}, which is not read")
    end_run()
    return parts


class _Cursor:
    """A place in the bytes of one message."""

    def __init__(self, view: memoryview, plan: dict[str, tuple[_Part, ...]], order: str, aligned: bool) -> None:
        self.position = 0
        self._view = view
        self._plan = plan
        self._aligned = aligned
        self._length = struct.Struct(order + "I")
        self._budget = MOST_VALUES

    def message(self, kind: str) -> dict[str, Any]:
        parts = self._plan[kind]
        self._spend(1 + len(parts))
        fields: dict[str, Any] = {}
        for part in parts:
            if isinstance(part, _Scalars):
                fields.update(zip(part.names, self._unpack(part.packed, part.alignment), strict=True))
            elif isinstance(part, _Numbers):
                fields[part.name] = self._numbers(part)
            elif isinstance(part, _Texts):
                fields[part.name] = (
                    self._text() if part.count is None else [self._text() for _ in range(self._many(part.count))]
                )
            elif part.count is None:
                fields[part.name] = self.message(part.kind)
            else:
                fields[part.name] = [self.message(part.kind) for _ in range(self._many(part.count))]
        return fields

    def _unpack(self, packed: struct.Struct, alignment: int) -> tuple[Any, ...]:
        start = self._align(alignment)
        if start + packed.size > len(self._view):
            raise self._short()
        self.position = start + packed.size
        return packed.unpack_from(self._view, start)

    def _numbers(self, part: _Numbers) -> np.ndarray | memoryview:
        count = part.count if part.count != SEQUENCE else self._unpack(self._length, 4)[0]
        size = part.dtype.itemsize
        start = self._align(size) if count else self.position
        end = start + count * size
        if end > len(self._view):
            raise self._short()
        self.position = end
        if part.dtype == np.uint8:
            return self._view[start:end]
        return np.frombuffer(self._view[start:end], part.dtype)

    def _text(self) -> str:
        length = self._unpack(self._length, 4)[0]
        start, end = self.position, self.position + length
        if end > len(self._view):
            raise self._short()
        self.position = end
        text = bytes(self._view[start:end])
        if self._aligned and text.endswith(b"\0"):
            text = text[:-1]
        try:
            return text.decode("utf-8")
        except UnicodeDecodeError:
            raise Undecodable("a text is not UTF-8") from None

    def _many(self, count: int) -> int:
        if count == SEQUENCE:
            count = self._unpack(self._length, 4)[0]
        self._spend(count)
        return count

    def _spend(self, values: int) -> None:
        self._budget -= values
        if self._budget < 0:
            raise Undecodable(f"claims more than {MOST_VALUES} values")

    def _align(self, alignment: int) -> int:
        return self.position + -self.position % alignment if self._aligned else self.position

    def _short(self) -> Undecodable:
        return Undecodable("ends too early")

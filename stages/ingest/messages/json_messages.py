"""Foxglove messages in JSON -> records."""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Callable
from typing import Any, NoReturn

from scenewright.stages.ingest.messages.foxglove_messages import CONVERTERS, type_of
from scenewright.stages.ingest.messages.records import Record, Undecodable

LARGEST_MESSAGE = 1 << 27
"""Bytes of one JSON message that are parsed: parsing takes up to twenty times as much memory."""


def json_decoder(type_name: str) -> Callable[[bytes], tuple[Record, ...]] | None:
    """Return what decodes messages of a Foxglove type, raising Undecodable; None for types without a record."""
    name = type_of(type_name)
    if name not in CONVERTERS:
        return None
    convert = CONVERTERS[name]

    def decode(data: bytes) -> tuple[Record, ...]:
        fields = _lower_case_names(parse_object(data))
        if isinstance(fields.get("data"), str):
            fields["data"] = _decode_base64(fields["data"])
        return convert(fields)

    return decode


def parse_object(data: bytes) -> dict[str, Any]:
    """Parse a JSON object. Raises Undecodable, also for NaN and infinity, which JSON does not have."""
    if len(data) > LARGEST_MESSAGE:
        raise Undecodable(f"a JSON message of more than {LARGEST_MESSAGE} bytes")
    try:
        parsed = json.loads(data.decode("utf-8"), parse_constant=_refuse)
    except json.JSONDecodeError as error:
        raise Undecodable(f"no JSON: {error.msg}") from None
    except (ValueError, RecursionError):  # no UTF-8, a number of thousands of digits, nested too deep
        raise Undecodable("no JSON: not to be read") from None
    if not isinstance(parsed, dict):
        raise Undecodable("the JSON is not an object")
    return parsed


def _refuse(constant: str) -> NoReturn:
    raise Undecodable(f"no JSON: {constant} is not a number")


def _lower_case_names(fields: dict[str, Any]) -> dict[str, Any]:
    """D, K, R, P are upper case in some writers; what is nested has lower-case names in all of them."""
    return {name.lower(): value for name, value in fields.items()}


def _decode_base64(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise Undecodable("field 'data' is not base64") from None

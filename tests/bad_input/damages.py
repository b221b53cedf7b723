"""Damages that the bytes of any format may have, declared once."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TypeVar

Item = TypeVar("Item")
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
EXTREMES = (b"nan", b"-inf", b"1e400", b"-1", b"0", b"9" * 20, b"x", b"../")
"""What numbers in a text are replaced by."""

WHOLE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "cut in the middle": lambda data: data[: len(data) // 2],
    "words": lambda data: b"Nothing of the kind, but longer.",
    "no UTF-8": lambda data: b"\xff\xfe\x00\x01" + data,
    "a zero byte": lambda data: data[: len(data) // 2] + b"\0" + data[len(data) // 2 :],
    "more behind its end": lambda data: data + b"\x17more\xff",
    "nested": lambda data: b"[" * 20_000,
    "nested objects": lambda data: b'{"a":' * 20_000,
}
"""Damage -> the damaged bytes."""


def flipped(data: bytes, place: int, mask: int = 0x10) -> bytes:
    """Return the bytes with bits of one of them flipped."""
    return data[:place] + bytes([data[place] ^ mask]) + data[place + 1 :]


def replaced(data: bytes, place: int, content: bytes) -> bytes:
    """Return the bytes with others written over them."""
    return data[:place] + content + data[place + len(content) :]


def spread(items: Sequence[Item], most: int) -> list[Item]:
    """Return at most so many items, evenly spread."""
    step = max(1, -(-len(items) // most))
    return list(items[::step])


def cuts(data: bytes, most: int = 60) -> list[bytes]:
    """Return beginnings of the bytes, none of them whole."""
    return [data[:place] for place in spread(range(len(data)), most)]


def changes(data: bytes, most: int = 60) -> list[bytes]:
    """Return the bytes with a bit flipped, and with a number replaced, at places all over them."""
    flips = [flipped(data, place, 1 << place % 8) for place in spread(range(len(data)), most)]
    numbers = enumerate(spread(list(NUMBER.finditer(data)), most))
    return flips + [
        data[: found.start()] + EXTREMES[number % len(EXTREMES)] + data[found.end() :] for number, found in numbers
    ]

"""Checks of the parts that messages of all dialects share: stamps, names, numbers, sizes, rigid transforms.

Fields come as dictionaries with lower-case names, whatever wrote them. Everything here raises Undecodable.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scenewright.stages.ingest.messages.records import Undecodable

LONGEST_NAME = 4096
"""Characters of a frame, an encoding or a model; what is longer is no name."""
LARGEST_SIZE = 2**32 - 1
"""Largest width, height or offset that a message may state: an unsigned 32-bit number."""
LARGEST_SECONDS = 2**33
"""About the year 2242: stamps stay far within 64 bits of nanoseconds."""
MOST_NUMBERS = 256
"""Most numbers of a list in a message; a bound, by eye."""
NORM_TOLERANCE = 0.02
"""Largest difference of the norm of a quaternion from 1; by eye."""

Fields = dict[str, Any]


def part(fields: Fields, name: str) -> Any:
    """Return a field that must be there."""
    try:
        return fields[name]
    except KeyError:
        raise Undecodable(f"no field {name!r}") from None


def nested(fields: Fields, name: str) -> Fields:
    """Return a field that is a message of its own."""
    value = part(fields, name)
    if not isinstance(value, dict):
        raise Undecodable(f"field {name!r} is not a message")
    return value


def stamp_of(time: Any) -> int:
    """Return {sec, nsec} (or nanosec, secs, seconds, nanos, ...) in nanoseconds; None gives 0."""
    if time is None:
        return 0
    if not isinstance(time, dict):
        raise Undecodable("the stamp is not a pair of seconds and nanoseconds")
    seconds = _first(time, ("sec", "secs", "seconds"))
    nanoseconds = _first(time, ("nsec", "nanosec", "nsecs", "nanos", "nanoseconds"))
    if not 0 <= seconds < LARGEST_SECONDS or not 0 <= nanoseconds < 1_000_000_000:
        raise Undecodable("the stamp is negative, or its nanoseconds make a second and more")
    return seconds * 1_000_000_000 + nanoseconds


def _first(time: Fields, names: tuple[str, ...]) -> int:
    value = next((time[name] for name in names if name in time), None)
    if isinstance(value, bool) or not isinstance(value, int):
        raise Undecodable(f"the stamp has no whole number {names[0]!r}")
    return value


def name_of(fields: Fields, name: str) -> str:
    """Return a field that is a short text."""
    value = part(fields, name)
    if not isinstance(value, str):
        raise Undecodable(f"field {name!r} is not text")
    if len(value) > LONGEST_NAME:
        raise Undecodable(f"field {name!r} has more than {LONGEST_NAME} characters")
    return value


def frame_of(fields: Fields, name: str = "frame_id") -> str:
    """Return the name of a frame, without the leading slash that ROS 1 programs write and tf2 leaves out."""
    return name_of(fields, name).removeprefix("/")


def size_of(fields: Fields, name: str) -> int:
    """Return a field that is a whole number from 0 to 2^32 - 1."""
    value = part(fields, name)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_SIZE:
        raise Undecodable(f"field {name!r} is not a size")
    return value


def bytes_of(fields: Fields, name: str) -> bytes:
    """Return a field that is bytes."""
    value = part(fields, name)
    if not isinstance(value, bytes | memoryview):
        raise Undecodable(f"field {name!r} is not an array of bytes")
    return bytes(value)


def numbers_of(fields: Fields, name: str, lengths: tuple[int, ...] | None = None) -> tuple[float, ...]:
    """Return a field that is a list of finite numbers, of one of the `lengths`, or of any up to MOST_NUMBERS."""
    value = part(fields, name)
    if not isinstance(value, list | np.ndarray):
        raise Undecodable(f"field {name!r} is not a list of numbers")
    if len(value) > MOST_NUMBERS or (lengths is not None and len(value) not in lengths):
        raise Undecodable(f"field {name!r} has not as many numbers as it should")
    numbers = value.tolist() if isinstance(value, np.ndarray) else value
    return tuple(_finite(number, name) for number in numbers)


def number_of(fields: Fields, name: str) -> float:
    """Return a field that is a finite number."""
    return _finite(part(fields, name), name)


def _finite(number: Any, name: str) -> float:
    if isinstance(number, bool) or not isinstance(number, int | float):
        raise Undecodable(f"field {name!r} is not a number")
    try:
        value = float(number)
    except OverflowError:
        raise Undecodable(f"field {name!r} is not finite") from None
    if not math.isfinite(value):
        raise Undecodable(f"field {name!r} is not finite")
    return value


def vector_of(fields: Fields) -> np.ndarray:
    """Return (3,) of a message with x, y, z."""
    return np.array([number_of(fields, axis) for axis in "xyz"])


def rigid(translation: Fields, rotation: Fields) -> np.ndarray:
    """Return (4, 4) of a message with x, y, z and one with x, y, z, w; the quaternion's norm within 2 % of 1.

    Written out, as logs hold hundreds of thousands of these and a general library takes five times as long.
    """
    x, y, z = (number_of(translation, axis) for axis in "xyz")
    i, j, k, r = (number_of(rotation, axis) for axis in "xyzw")
    norm = math.hypot(i, j, k, r)
    if abs(norm - 1) > NORM_TOLERANCE:
        raise Undecodable("the norm of a quaternion is not 1: no rigid transform")
    i, j, k, r = i / norm, j / norm, k / norm, r / norm
    return np.array(
        (
            (1 - 2 * (j * j + k * k), 2 * (i * j - k * r), 2 * (i * k + j * r), x),
            (2 * (i * j + k * r), 1 - 2 * (i * i + k * k), 2 * (j * k - i * r), y),
            (2 * (i * k - j * r), 2 * (j * k + i * r), 1 - 2 * (i * i + j * j), z),
            (0.0, 0.0, 0.0, 1.0),
        )
    )


def pose_matrix(pose: Fields) -> np.ndarray:
    """Return (4, 4) parent_from_child of a message with position and orientation."""
    return rigid(nested(pose, "position"), nested(pose, "orientation"))

"""Durations, sizes and seed ranges as people write them in a batch file."""

from __future__ import annotations

import re

_QUANTITY = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]+)")
_RANGE = re.compile(r"([0-9]+)\s*-\s*([0-9]+)")
_SECONDS = {"s": 1, "min": 60, "h": 3600, "d": 86400}
"""Seconds a unit of time."""
_BYTES = {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12} | {
    "KiB": 2**10,
    "MiB": 2**20,
    "GiB": 2**30,
    "TiB": 2**40,
}
"""Bytes a unit of size."""
LARGEST_SEED_RANGE = 100_000
"""Most seeds of a range: more is a typing error, not an experiment."""


def _parse(text: str, units: dict[str, int], example: str) -> float:
    match = _QUANTITY.fullmatch(text.strip())
    if match is None or match[2] not in units:
        raise ValueError(f"{text!r} is not a number with a unit ({', '.join(units)}), such as {example!r}")
    value = float(match[1]) * units[match[2]]
    if value <= 0:
        raise ValueError(f"{text!r} is not above zero")
    return value


def parse_seconds(text: str) -> float:
    """Return a duration [s] from text such as `90 s`, `20 min`, `1.5 h`. Raises ValueError."""
    return _parse(text, _SECONDS, "20 min")


def parse_bytes(text: str) -> int:
    """Return a size [bytes] from text such as `4 GiB`, `500 MB`. Raises ValueError."""
    return max(1, int(_parse(text, _BYTES, "4 GiB")))


def parse_seed_range(text: str) -> tuple[int, ...]:
    """Return the seeds of `1-10`, both ends included. Raises ValueError."""
    match = _RANGE.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is not a range of seeds, such as '1-10'")
    first, last = int(match[1]), int(match[2])
    if last < first:
        raise ValueError(f"{text!r} ends before it begins")
    if last - first >= LARGEST_SEED_RANGE:
        raise ValueError(f"{text!r} are more than {LARGEST_SEED_RANGE} seeds")
    return tuple(range(first, last + 1))


def format_seconds(seconds: float) -> str:
    """Return a duration [s] for people: `12.3 s`, `4 min 10 s`, `2 h 05 min`."""
    if seconds < 99.95:
        return f"{seconds:.1f} s"
    whole_seconds = round(seconds)
    if whole_seconds < 3600:
        return f"{whole_seconds // 60} min {whole_seconds % 60:02d} s"
    return f"{whole_seconds // 3600} h {whole_seconds % 3600 // 60:02d} min"


def format_bytes(size: float) -> str:
    """Return a size [bytes] for people, in MiB or GiB."""
    return f"{size / 2**30:.1f} GiB" if size >= 2**30 else f"{size / 2**20:.0f} MiB"

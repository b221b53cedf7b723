"""Values at limits: of the types that JSON, numpy, file systems, terminals and formats have."""

from __future__ import annotations

import random
from typing import Any

INTEGERS = (
    *(0, 1, -1, 2, 3, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 1_000_000, 2**24 + 1, 2**31 - 1, 2**31),
    *(-(2**31), -(2**31) - 1, 2**32 - 1, 2**32, 2**53, 2**63 - 1, -(2**63), 2**63, 2**64, 10_000),
)
FLOATS = (
    *(0.0, -0.0, 5e-324, 1e-300, 1e-12, 1e-6, 1e-3, 0.5, 1.0, -1.0, 10.0, -10.0, 1e3, -1e3, 1e6, 1e9, 1e20, -1e20),
    *(3.5e38, 1e150, 1.7e308, -1.7e308, float("nan"), float("inf"), float("-inf"), 3.141592653589793, 1e-3),
)
STRINGS = (
    *("", " ", "a", "x" * 200, "x" * 5000, "стол", "机", "كرسي", "e\u0301", "\u202eabc", "\x1b[2J\x07", "\0", "a\nb"),
    *("../x", "..", ".", "/etc/passwd", "a/b", "a\\b", "%s", "{0}", "$HOME", "NaN", "None", "null", "1e400", "0x10"),
    *("<b>&amp;", "'; --", '"', "scene", "floor", "wall", "world", "table_1", "surroundings", "\ud800", "🪑", "-x"),
    *("[1]", "*", "٣", "²", "1_000", "+5", "body", "manifest.json", "CON", "a" * 64 + "\u0300" * 64),
)
"""Empty, long, of every script, with controls, paths, formats; words that mean something to the program."""


def any_value(rng: random.Random) -> Any:
    """Return some JSON value."""
    return rng.choice(
        (
            rng.choice(INTEGERS),
            rng.choice(FLOATS),
            rng.choice(STRINGS),
            None,
            True,
            [],
            {},
            [rng.choice(FLOATS)] * 3,
            [[]],
            [None],
        )
    )


def instead_of(value: Any, rng: random.Random) -> Any:
    """Return a value of the same type at its limits; sometimes one of another type."""
    if rng.random() < 0.06:
        return any_value(rng)
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        near = (value + 1, value - 1, -value, value * 1000)
        return rng.choice(near) if rng.random() < 0.3 else rng.choice(INTEGERS)
    if isinstance(value, float):
        near = (-value, value * 1e3, value * 1e-3, value + 1.0, float(round(value)))
        return rng.choice(near) if rng.random() < 0.4 else rng.choice(FLOATS)
    if isinstance(value, str):
        return rng.choice(STRINGS)
    if isinstance(value, list):
        return rng.choice(([], value[:1], value[::-1], value * 2, [value], value[:-1], [*value, *value[:1]]))
    if isinstance(value, dict):
        return rng.choice(({}, None, dict(list(value.items())[:1])))
    return any_value(rng)

"""Durations, sizes and seed ranges as people write them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.stages.engine.batch.quantities import (
    format_bytes,
    format_seconds,
    parse_bytes,
    parse_seconds,
    parse_seed_range,
)


def test_units() -> None:
    assert [parse_seconds(text) for text in ("90 s", "20 min", "1.5h", "2 d")] == [90, 1200, 5400, 172800]
    assert [parse_bytes(text) for text in ("4 GiB", "500MB", "1.5 kB", "7 B")] == [2**32, 500_000_000, 1500, 7]


@pytest.mark.parametrize(
    "text", ["", "20", "20 minutes", "-1 s", "0 s", "nan s", "1e3 s", "4 gib", "four min", "1 s 2 s"]
)
def test_what_is_no_quantity_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        parse_seconds(text)
    with pytest.raises(ValueError):
        parse_bytes(text)


def test_seed_ranges() -> None:
    assert parse_seed_range("1-10") == tuple(range(1, 11))
    assert parse_seed_range("7 - 7") == (7,)
    for text in ("10-1", "1", "a-b", "1-1000000000", "-1-3", "1-2-3"):
        with pytest.raises(ValueError):
            parse_seed_range(text)


@given(st.text(max_size=12))
def test_any_text_gives_a_value_or_a_value_error(text: str) -> None:
    for parse in (parse_seconds, parse_bytes, parse_seed_range):
        try:
            parse(text)
        except ValueError as error:
            assert "\n" not in str(error).replace(repr(text), "")


def test_formats() -> None:
    assert [format_seconds(s) for s in (0.04, 99.9, 99.96, 250, 7500)] == [
        "0.0 s",
        "99.9 s",
        "1 min 40 s",
        "4 min 10 s",
        "2 h 05 min",
    ]
    assert (format_bytes(300 * 2**20), format_bytes(1.5 * 2**30)) == ("300 MiB", "1.5 GiB")

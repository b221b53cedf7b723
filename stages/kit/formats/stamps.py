"""Columns of time stamps in text: seconds, or milli-, micro- or nanoseconds, exact to the nanosecond."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

import numpy as np
from scenewright.schemas.errors import BadInput

LATEST_STAMP = 9_000_000_000
"""Seconds since 1970: stamps in nanoseconds stay within 64 bits."""
EARLIEST = 1_000_000_000
"""Seconds since 1970 of September 2001, before which nothing was recorded that is read here."""
LONGEST_STEP, USUAL_STEP = 1000, 10
"""Median step between pictures or poses [s]: no recording that begins at 0 has a longer one, so that its stamps are in
the unit in which the step is a usual one."""
LONGEST_PAUSE = 100_000
"""Median step [s] that no recording has, whatever its times are: more than a day."""
UNITS = {"s": 0, "ms": 3, "us": 6, "ns": 9}
"""Unit -> digits of a second."""
PLAIN = re.compile(r"[0-9]{1,18}")


@dataclass(frozen=True)
class StampColumn:
    """A column of stamps of one unit."""

    stamps: tuple[int | None, ...]
    """[ns]; None for what is no time."""
    unit: str
    """Of UNITS."""

    @property
    def note(self) -> str:
        """What was taken, for people; empty for seconds."""
        return "" if self.unit == "s" else f"stamps in {self.unit}"


def read_column(texts: Sequence[str]) -> StampColumn:
    """Return the stamps of a column, all in one unit: the one that makes them times since 1970, else seconds, else the
    one in which their steps are usual. What is no time from 0 on is None."""
    values = [_value(text) for text in texts]
    known = [value for value in values if value is not None]
    digits = UNITS[(unit := _unit_of(known))]
    stamps = [None if value is None else int(value.scaleb(9 - digits).to_integral_value()) for value in values]
    latest = LATEST_STAMP * 10**9
    return StampColumn(tuple(stamp if stamp is not None and stamp < latest else None for stamp in stamps), unit)


def exact_stamps(texts: Sequence[str], where: Sequence[str]) -> StampColumn:
    """Return `read_column`. Raises BadInput, beginning with its place in `where` (N,), for what is no time."""
    column = read_column(texts)
    for text, place, stamp in zip(texts, where, column.stamps, strict=True):
        if stamp is None and _number(text) is None:
            raise BadInput(f"{place}: {text!r:.40} is not a time stamp")
        if stamp is None:
            raise BadInput(f"{place}: time stamp {text:.40} is not between 0 and {LATEST_STAMP} seconds")
    return column


def spans_text(frames: np.ndarray, poses: np.ndarray) -> str:
    """Return in words when frames (N,) and poses (M,) [ns] are, and how far apart they begin."""
    apart = int(poses.min()) - int(frames.min())
    spans = (f"from {int(of.min()) * 1e-9:.6f} to {int(of.max()) * 1e-9:.6f} s" for of in (frames, poses))
    relation = f"{abs(apart) * 1e-9:.9g} s {'after' if apart > 0 else 'before'} the frames"
    return f"frames are {next(spans)}, poses {next(spans)}, which begin {relation}"


def _number(text: str) -> Decimal | None:
    try:
        return Decimal(text)
    except InvalidOperation:
        return None


def _value(text: str) -> Decimal | None:
    value = Decimal(text) if PLAIN.fullmatch(text) else _number(text)
    return value if value is not None and value.is_finite() and 0 <= value < Decimal(LATEST_STAMP).scaleb(9) else None


def _unit_of(values: Sequence[Decimal]) -> str:
    largest, step = max(values, default=Decimal(0)), _step(values)
    for unit, digits in UNITS.items():
        if EARLIEST <= largest.scaleb(-digits) < LATEST_STAMP and step / 10**digits < LONGEST_PAUSE:
            return unit
    if largest < LATEST_STAMP and step < LONGEST_STEP:
        return "s"
    return next((unit for unit, digits in UNITS.items() if step / 10**digits < USUAL_STEP), "ns")


def _step(values: Sequence[Decimal]) -> float:
    """Median of the steps between values that differ; 0 with fewer than two."""
    distinct = np.unique(np.array([float(value) for value in values]))
    return float(np.median(np.diff(distinct))) if len(distinct) > 1 else 0.0

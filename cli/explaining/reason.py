"""One reason in words and in numbers, and the phrases that several kinds share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from scenewright.schemas.edits import AppliedEditsFile

SHORT = 0.1
"""Lengths under it are said in millimetres [m]."""


@dataclass(frozen=True)
class Reason:
    """A sentence or a few about one thing."""

    says: str
    facts: Mapping[str, Any] = field(default_factory=dict)
    """The names and numbers that it says, as the artifact records them: JSON."""


Reasons = dict[str, list[Reason]]
"""Name -> its reasons, in the order in which they were decided."""


def length(metres: float) -> str:
    """Return a length [m] in words."""
    return f"{1000 * metres:.0f} mm" if abs(metres) < SHORT else f"{metres:.2f} m"


def percent(share: float) -> str:
    """Return a share (0 to 1) in words."""
    return f"{100 * share:.0f} %"


def listed(words: Iterable[str]) -> str:
    """Return words joined by commas and a last `and`."""
    *first, last = list(words) or [""]
    return f"{', '.join(first)} and {last}" if first else last


def counted(number: int, word: str) -> str:
    """Return a number with its word, in the plural where it is not one."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def numbered(rows: Mapping[str, float], digits: int = 2) -> str:
    """Return names with their numbers, the largest first."""
    order = sorted(rows.items(), key=lambda row: (-row[1], row[0]))
    return listed(f"{name} {value:.{digits}f}" for name, value in order)


def edit_reasons(edits: AppliedEditsFile | None) -> Reasons:
    """Return what people changed, by the names of the things as they are after it."""
    rows: Reasons = {}
    for edit in () if edits is None else edits.edits:
        who = f" by {edit.by}" if edit.by else ""
        fate = {"applied": "was applied", "already": "asked for what was so already", "conflict": "was not applied"}
        says = f"Edit {edit.number}{who}, {edit.what}, {fate[edit.status]}"
        says += f": {edit.reason}." if edit.reason else "."
        says += f" Its note: {edit.note}" if edit.note else ""
        for name in edit.things:
            rows.setdefault(name, []).append(Reason(says, edit.model_dump(mode="json", exclude={"things"})))
    return rows


def merged(parts: Sequence[Reasons]) -> Reasons:
    """Return the reasons of several sources, each name's in their order."""
    rows: Reasons = {}
    for part in parts:
        for name, reasons in part.items():
            rows.setdefault(name, []).extend(reasons)
    return rows

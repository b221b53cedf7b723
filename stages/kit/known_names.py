"""Names on the command line: those of units and axes, and lists that are checked against those that there are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from scenewright.schemas.errors import UsageError

UnitName = Literal["m", "dm", "cm", "mm", "inch", "foot"]
AxisName = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


def check_names(option: str, names: Sequence[str], known: Sequence[str]) -> None:
    """Raise UsageError for the first of an option's names that is not known."""
    for name in names:
        if name not in known:
            raise UsageError(f"{option}: there is no {name!r}", hint=f"choose one of {', '.join(known)}")

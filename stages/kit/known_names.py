"""Lists of names on the command line, checked against those that there are."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.schemas.errors import UsageError


def check_names(option: str, names: Sequence[str], known: Sequence[str]) -> None:
    """Raise UsageError for the first of an option's names that is not known."""
    for name in names:
        if name not in known:
            raise UsageError(f"{option}: there is no {name!r}", hint=f"choose of {', '.join(known)}")

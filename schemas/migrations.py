"""Steps from one schema version of a kind to the next. All are kept; each writes into a new folder.

A migration is a pure function `(old_folder, new_folder) -> None` that writes the payload of version n + 1 from that
of version n. Every kind is at version 1 today, so the table is empty; the machinery is tested with a kind of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

Migration = Callable[[Path, Path], None]

MIGRATIONS: dict[tuple[str, int], Migration] = {}
"""(kind, from version) -> the step to the next version."""


def migration(kind: str, from_version: int) -> Callable[[Migration], Migration]:
    """Register a step from `from_version` to the next."""

    def register(function: Migration) -> Migration:
        MIGRATIONS[(kind, from_version)] = function
        return function

    return register

"""Goals in words: `6 slices, 8 cubes`."""

from __future__ import annotations

import re
from typing import get_args

from scenewright.schemas.cutting_demonstrations import CategoryName
from scenewright.schemas.errors import UsageError

MOST = 200
"""Fragments of a goal in words."""
_PART = re.compile(r"\s*(\d{1,6})\s+([a-z]+?)s?\s*")


def read_words(text: str) -> list[tuple[int, CategoryName]]:
    """Return the counts and categories of a goal. Raises UsageError naming what cannot be read."""
    categories: dict[str, CategoryName] = {name.removesuffix("s"): name for name in get_args(CategoryName)}
    hint = f"write for example 6 slices, 8 cubes; there are {', '.join(categories.values())}"
    counts: dict[CategoryName, int] = {}
    for part in re.split(r",|\band\b", text):
        match = _PART.fullmatch(part)
        if match is None:
            raise UsageError(f"--goal: {part.strip()!r:.60} is not a number with a category", hint=hint)
        name = categories.get(match[2].removesuffix("s"))
        if name is None:
            raise UsageError(f"--goal: there is no category {match[2]!r:.40}", hint=hint)
        if name in counts:
            raise UsageError(f"--goal: {name} are named twice", hint="add their numbers")
        counts[name] = int(match[1])
    for name, count in counts.items():
        if count == 0:
            raise UsageError(f"--goal: 0 {name}", hint="leave them out")
    if sum(counts.values()) > MOST:
        raise UsageError(f"--goal: {sum(counts.values())} fragments, at most {MOST} are planned", hint="ask for fewer")
    return [(count, name) for name, count in counts.items()]

"""Calls written down wrongly, at the rate of the failure table: a `rules` brain makes none of its own."""

from __future__ import annotations

import re
from collections.abc import Callable

EXECUTION = re.compile(r"\b(navigate|grasp|place|place_among|open|close)\((.*)\)\s*$")
KINDS = ("place", "name", "call")
"""Slips of 3.4.3: placing without a grasp before, a name where an object belongs; and a call of another interface."""


class Slips:
    """Mistakes in writing. `slips(key)` says whether and how; the same key makes the same mistake again."""

    def __init__(self, happens: Callable[[int], float | None]) -> None:
        """`happens(key)` returns None for no mistake, or a number in [0, 1) that says which."""
        self._happens = happens

    def written(self, line: str, key: int) -> str:
        """Return a line as it gets written."""
        match = EXECUTION.search(line)
        which = self._happens(key) if match else None
        if match is None or which is None:
            return line
        kind = KINDS[int(which * len(KINDS))]
        if kind == "place" and match[1] == "grasp":
            return f"{line[: match.start()]}place({match[2]})"
        if kind == "call":
            wrong_name = {"grasp": "pick", "place": "put", "navigate": "go_to"}.get(match[1], f"{match[1]}_it")
            return f"{line[: match.start()]}{wrong_name}({match[2]})"
        return f'{line[: match.start()]}{match[1]}("it")'

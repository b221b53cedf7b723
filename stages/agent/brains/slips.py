"""Calls written down wrongly, at the rate of the failure table: a `rules` brain makes none of its own."""

from __future__ import annotations

import re
from collections.abc import Callable

EXECUTION = re.compile(r"\b(navigate|grasp|place|place_among|open|close)\((.*)\)\s*$")
KINDS = ("place", "name", "call")
"""As in 3.4.3: placing without a grasp before, a name where an object belongs; and a call of another interface."""


class Slips:
    """Mistakes in writing. `slips(key)` says whether and how; the same key makes the same mistake again."""

    def __init__(self, happens: Callable[[int], float | None]) -> None:
        """`happens(key)` returns None for no mistake, or a number in [0, 1) that says which."""
        self._happens = happens

    def written(self, line: str, key: int) -> str:
        """Return a line as it gets written."""
        found = EXECUTION.search(line)
        which = self._happens(key) if found else None
        if found is None or which is None:
            return line
        kind = KINDS[int(which * len(KINDS))]
        if kind == "place" and found[1] == "grasp":
            return f"{line[: found.start()]}place({found[2]})"
        if kind == "call":
            other = {"grasp": "pick", "place": "put", "navigate": "go_to"}.get(found[1], f"{found[1]}_it")
            return f"{line[: found.start()]}{other}({found[2]})"
        return f'{line[: found.start()]}{found[1]}("it")'

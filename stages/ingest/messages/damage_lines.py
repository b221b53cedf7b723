"""What could not be read of a file, in lines for people."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.errors import BadInput

LONGEST = 200
"""Lines that are kept; of a file that is damaged everywhere the rest is only counted."""
HINT = "copy it again; of a torn log `scenewright ingest --damage salvage` takes what is whole"


class DamageLines(list[str]):
    """A list of lines in which nothing stands twice, and in which equal faults are counted in one line.

    Without `salvage` the first fault that is `found` refuses the file.
    """

    def __init__(self, path: Path, *, salvage: bool) -> None:
        super().__init__()
        self.path = path
        self.salvage = salvage
        self._noted: set[str] = set()
        self._tallied: dict[str, tuple[int, int]] = {}
        self._unlisted = 0

    def found(self, what: str, times: int = 0) -> None:
        """Note a fault, once, or as many times as it occurred. Raises BadInput without `salvage`."""
        if not self.salvage:
            raise BadInput(f"{self.path}: {what}", hint=HINT)
        if times:
            self.tally(what, times)
        else:
            self.note(what)

    def note(self, line: str) -> None:
        """Append a line, unless it was noted before."""
        if line in self._noted:
            return
        self._noted.add(line)
        if len(self) < LONGEST:
            self.append(line)
            return
        self._unlisted += 1
        self[LONGEST - 1] = f"and {self._unlisted + 1} faults more"

    def tally(self, what: str, times: int) -> None:
        """Say `N times: what` in one line, whose N grows."""
        if what not in self._tallied:
            if len(self) >= LONGEST - 1:  # the last line says how many more there are
                self.note(what)
                return
            self._tallied[what] = (len(self), 0)
            self.append("")
        index, total = self._tallied[what]
        self._tallied[what] = (index, total + times)
        self[index] = f"{total + times} times: {what}"

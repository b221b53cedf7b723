"""One trial of one arm on one table, as a line of runs.jsonl."""

from __future__ import annotations

from pathlib import Path

from schemas.base import Model


class Run(Model):
    """What a trial came to. `case`: `<tier>/fast[/exact][/thesis15][/delay<s>]`."""

    arm: str
    case: str
    seed: int
    time: float
    trips: int
    moved: int
    pulls: int
    stacks: int
    failed: bool

    @property
    def objects_per_trip(self) -> float:
        """Items brought to the bin over trips."""
        return self.moved / max(self.trips, 1)


def read_runs(path: Path) -> list[Run]:
    """Return the trials of a log; a line that was cut off at the end is taken out of the file."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return [Run.model_validate_json(line) for line in whole.split("\n") if line]

"""One reconstruction of one thread, as a line of thread.jsonl."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from schemas.base import Model


class ThreadRecord(Model):
    """What an arm made of one view, and how far off it was; lengths and distances in mm, -1 where there is no curve.

    `masks`: "true" or "learned". `distance`: from the curve's points to the true curve; `missed`: from the true points
    that both eyes see to the curve. `followed`: the share of those true points within 2 mm of the curve; `backward`:
    the share of the curve near the truth along which it runs against it. `inside_2sd`: the share of the curve's points
    whose distance to the truth is less than two of their standard deviations.
    """

    masks: str
    seed: int
    holder: str
    crossed: bool
    status: str
    remarks: tuple[str, ...]
    distance_mean: float
    distance_p95: float
    missed_mean: float
    missed_p95: float
    followed: float
    backward: float
    inside_2sd: float
    length: float
    true_length: float
    seen_length: float
    seconds: float

    @property
    def answered(self) -> bool:
        """There is a curve."""
        return self.status != "none"

    @property
    def whole(self) -> bool:
        """At least 95 % of the thread's true length is seen by both eyes."""
        return self.seen_length >= 0.95 * self.true_length

    @property
    def good(self) -> bool:
        """95 % of the curve lies within 2 mm of the truth, and 90 % of what both eyes see lies within 2 mm of it."""
        return self.answered and self.distance_p95 <= 2.0 and self.followed >= 0.9


def read_records(path: Path) -> list[ThreadRecord]:
    """Return the records of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, ThreadRecord)

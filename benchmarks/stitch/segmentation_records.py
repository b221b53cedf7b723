"""One picture's masks against the truth, as a line of segmentation.jsonl."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_log import read_log
from schemas.base import Model


class MaskRecord(Model):
    """Counts of pixels of one eye's picture: found and true, and found or true; of thread also those found that lie
    within a pixel of true thread, and true ones within a pixel of found thread. `tip`, `swage`: the distance [px] from
    the projected end to the found needle, -1 where this eye does not see the end. `two_mm`: 2 mm at the needle, [px].
    """

    rig: str
    seed: int
    eye: str
    holder: str
    light: str
    needle_both: int
    needle_either: int
    needle_true: int
    thread_both: int
    thread_either: int
    thread_true: int
    thread_true_near: int
    thread_found: int
    thread_found_near: int
    tip: float
    swage: float
    two_mm: float
    seconds: float


def read_masks(path: Path) -> list[MaskRecord]:
    """Return the records of a log; a line that was cut off at the end is taken out of the file."""
    return read_log(path, MaskRecord)

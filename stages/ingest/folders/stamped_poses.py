"""Trajectories with their own stamps (`t tx ty tz qx qy qz qw`), looked up at the stamps of images."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.transform_tree import TransformTree
from scenewright.stages.kit.formats.trajectories import number_rows, read_text, transform_from_numbers

LATEST_STAMP = 9_000_000_000
"""Seconds since 1970: stamps in nanoseconds stay within 64 bits."""


@dataclass(frozen=True)
class StampedPoses:
    """A trajectory, interpolated where it has no gap."""

    stamps: np.ndarray
    """(N,) int64 [ns] of the usable poses, in file order."""
    tree: TransformTree
    notes: tuple[str, ...]

    def at(self, stamp: int, parameters: IngestParameters) -> np.ndarray | None:
        """Return world_from_camera (4, 4) at `stamp` [ns], or None where the trajectory does not cover it."""
        gap, tolerance = round(parameters.maximum_transform_gap * 1e9), round(parameters.maximum_time_difference * 1e9)
        if not len(self.stamps) or not self.stamps.min() - tolerance <= stamp <= self.stamps.max() + tolerance:
            return None  # the tree would take a trajectory of one pose for a camera that never moves
        return self.tree.lookup("world", "camera", stamp, gap=gap, tolerance=tolerance)


def read_stamped_poses(path: Path, seconds_per_unit: float = 1.0) -> StampedPoses:
    """Read a trajectory. Lines that are no pose are left out and counted in the notes.

    Raises BadInput for a wrong number of columns, or what is no number.
    """
    tree, stamps, problems = TransformTree(), [], Counter[str]()
    rows = number_rows(path, 8)
    # Stamps since 1970 do not fit float64 to the nanosecond, so they are taken from the text.
    texts = [line.split(None, 1)[0] for line in read_text(path).splitlines() if line.split("#", 1)[0].split()]
    for (line, row), text in zip(rows, texts, strict=True):
        where = f"{path}: line {line}"
        try:
            stamp = round(exact_stamp(text, where) * seconds_per_unit)
        except BadInput:
            problems["no time"] += 1
            continue
        if not np.isfinite(row).all():
            problems["not finite"] += 1
            continue
        try:
            pose = transform_from_numbers(row[1:], where)
        except BadInput:
            problems["quaternion not of length 1"] += 1
            continue
        stamps.append(stamp)
        tree.add("world", "camera", stamp, pose)
    notes: tuple[str, ...] = ()
    if problems:
        listed = ", ".join(f"{reason}: {count}" for reason, count in sorted(problems.items()))
        notes = (f"WARNING: {sum(problems.values())} of {len(rows)} lines of {path.name} are no poses ({listed})",)
    return StampedPoses(np.array(stamps, np.int64), tree, notes)


def exact_stamp(text: str, where: str) -> int:
    """Return a time in seconds, written in decimals, in whole nanoseconds. Raises BadInput for what is no time."""
    try:
        seconds = Decimal(text)
    except InvalidOperation:
        raise BadInput(f"{where}: {text!r:.40} is no time stamp") from None
    if not seconds.is_finite() or not 0 <= seconds < LATEST_STAMP:
        raise BadInput(f"{where}: time stamp {text:.40} is not between 0 and {LATEST_STAMP} seconds")
    return int(seconds.scaleb(9).to_integral_value())

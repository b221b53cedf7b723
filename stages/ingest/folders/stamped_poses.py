"""Trajectories with their own stamps (`t tx ty tz qx qy qz qw`), looked up at the stamps of images."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.transform_tree import TransformTree
from scenewright.stages.kit.formats.stamps import spans_text
from scenewright.stages.kit.formats.trajectories import read_stamped_rows


@dataclass(frozen=True)
class StampedPoses:
    """A trajectory, interpolated where it has no gap."""

    stamps: np.ndarray
    """(N,) int64 [ns] of the usable poses, in file order."""
    tree: TransformTree
    notes: tuple[str, ...]
    name: str = "trajectory"
    """Of the file."""

    def at(self, stamp: int, parameters: IngestParameters) -> np.ndarray | None:
        """Return world_from_camera (4, 4) at `stamp` [ns], or None where the trajectory does not cover it."""
        gap, tolerance = round(parameters.maximum_transform_gap * 1e9), round(parameters.maximum_time_difference * 1e9)
        if not len(self.stamps) or not self.stamps.min() - tolerance <= stamp <= self.stamps.max() + tolerance:
            return None  # the tree would take a trajectory of one pose for a camera that never moves
        return self.tree.lookup("world", "camera", stamp, gap=gap, tolerance=tolerance)


def coverage_notes(
    poses: StampedPoses, frames: Sequence[int], posed: Sequence[bool], parameters: IngestParameters
) -> tuple[str, ...]:
    """Return what to know of frames at stamps (N,) [ns] of which not all are `posed`: how far off the clocks are, and
    the option that helps."""
    if all(posed) or not len(poses.stamps):
        return ()
    stamps, times = np.unique(poses.stamps), np.array(frames, np.int64)
    lacking = np.sort(times[~np.array(posed, dtype=bool)])
    counted = f"{len(lacking)} of {len(times)} frames have no pose"
    notes = []
    if not any(posed):
        counted = f"WARNING: none of the {len(poses.stamps)} poses of {poses.name} is of a frame"
        notes.append(f"{counted}: {spans_text(times, stamps)}")
    if _are_rounded(poses.stamps, times):
        return (*notes, f"WARNING: stamps of {poses.name} are rounded: write them with all their decimals")
    inside = lacking[(lacking > stamps[0]) & (lacking < stamps[-1])]
    if len(inside):
        after = np.searchsorted(stamps, inside)
        needed = math.ceil((stamps[after] - stamps[after - 1]).max() / 1e7) / 100
        notes.append(
            f"{counted if any(posed) else f'{len(inside)} frames lie between two of them'}: poses of {poses.name} are "
            f"over {parameters.maximum_transform_gap:g} s apart there (--maximum-transform-gap {needed:g} interpolates)"
        )
    elif any(posed):
        notes.append(f"{counted}: {spans_text(times, stamps)}")
    elif not stamps[0] <= times.max() or not times.min() <= stamps[-1]:
        notes.append("write the stamps of the poses in the clock of the images")
    return tuple(notes)


def _are_rounded(stamps: np.ndarray, frames: np.ndarray) -> bool:
    """Whether most stamps of poses [ns] repeat others, or all are whole seconds while those of the frames are not."""
    repeat = 2 * len(np.unique(stamps)) <= len(stamps)
    return repeat or bool((stamps % 10**9 == 0).all() and (frames % 10**9 != 0).any())


def read_stamped_poses(path: Path, seconds_per_unit: float = 1.0) -> StampedPoses:
    """Read a trajectory. Lines that are no pose are left out and counted in the notes.

    `seconds_per_unit` is for stamps that are numbers of frames. Raises BadInput for a wrong number of columns, or what
    is no number.
    """
    rows = read_stamped_rows(path)
    tree, stamps = TransformTree(), [scaled(stamp, seconds_per_unit) for stamp in rows.stamps.tolist()]
    for stamp, pose in zip(stamps, rows.poses, strict=True):
        tree.add("world", "camera", stamp, pose)
    return StampedPoses(np.array(stamps, np.int64), tree, rows.notes, path.name)


def scaled(stamp: int, seconds_per_unit: float) -> int:
    """Return a stamp [ns] whose seconds are units: exact where a unit is a second."""
    return stamp if seconds_per_unit == 1 else round(stamp * seconds_per_unit)

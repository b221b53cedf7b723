"""Poses that are estimated from the log: what `poses` makes of a recording of the same walk, ten times as dense."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.measurement.pose_error import associate

from benchmarks.generated_rooms import make_room, room_of
from benchmarks.steps import made

DENSER = 10
"""Pictures of the recording for each one that is mapped: a map takes few, a camera that is tracked gives many."""


def estimated_poses(
    root: Path, seed: str, times: np.ndarray, *, size: tuple[int, int], rescaled: float = 0.0
) -> np.ndarray:
    """Return the estimated world_from_camera (N, 4, 4) of a room's pictures at `times` (N,) [s]: NaN where tracking was
    lost. The whole path is laid onto the given one; no more of that is looked at. Raises StepFailed."""
    frames = DENSER * (len(times) - 1) + 1
    room = make_room(root, room_of(seed), frames, size=size, rescaled=rescaled)
    lost = ("--accept", "tracking_lost", "--accept", "contradictory")
    path = made("poses", room.folder / "trajectory", "--sequence", room.sequence, *lost)
    return poses_at(times, *read_tum(path / "trajectory.tum"))


def poses_at(times: np.ndarray, path_times: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Return the poses (N, 4, 4) of a path (M,) [s], (M, 4, 4) at `times` (N,), NaN where it has none."""
    rows, found = associate(times, path_times)
    poses = np.full((len(times), 4, 4), np.nan)
    poses[rows] = path[found]
    return poses

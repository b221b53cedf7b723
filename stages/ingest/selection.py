"""Which frames of a log are used, and why the others are not."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.pose_conventions import converted
from scenewright.stages.ingest.source import Entry
from scenewright.stages.kit.geometry.transforms import is_rigid

POSE_TOLERANCE = 1e-2
"""Deviation from a rotation that rounding in a text file explains; more is no pose."""
NOT_SELECTED = "not_selected"
LARGEST_POSITION = 1e6
"""Metres from the origin: beyond it float32 no longer resolves centimetres, and nobody walked there."""


def select(
    entries: tuple[Entry, ...], parameters: IngestParameters, has_poses: bool
) -> tuple[list[Entry], Counter[str]]:
    """Return the frames worth loading, with checked poses in our convention, and the others counted by reason.

    A frame without a pose is left out only when other frames of the log have one. Selection by number counts the
    frames of every camera for itself, so that cameras which were triggered together stay together.
    """
    selected: list[Entry] = []
    drops: Counter[str] = Counter()
    last_times: dict[str, int] = {}
    counts: Counter[str] = Counter()
    every = parameters.every if isinstance(parameters.every, int) else 1
    for entry in entries:
        index = counts[entry.camera_name]
        counts[entry.camera_name] += 1
        stop = len(entries) if parameters.stop is None else parameters.stop
        if not parameters.start <= index < stop or (index - parameters.start) % every:
            drops[NOT_SELECTED] += 1
            continue
        pose, problem = checked_pose(entry.world_from_camera, has_poses)
        if pose is not None:
            pose = converted(pose, parameters.pose_convention, parameters.pose_scale)[0]
        problem = entry.problem or problem
        last_time = last_times.get(entry.camera_name, -1)
        time = round(entry.time * 1e9) if math.isfinite(entry.time) else -1
        if problem is None and not (time >= 0 and time > last_time):
            problem = "duplicate_stamp" if time == last_time and time >= 0 else "time_not_ascending"
        if problem is not None:
            drops[problem] += 1
            continue
        last_times[entry.camera_name] = time
        selected.append(replace(entry, world_from_camera=pose))
    return selected, drops


def checked_pose(matrix: np.ndarray | None, needed: bool) -> tuple[np.ndarray | None, str | None]:
    """Return the rigid (4, 4) pose nearest to `matrix`, or the reason why there is none."""
    if matrix is None:
        return None, "missing_pose" if needed else None
    if not np.isfinite(matrix).all():
        return None, "non_finite_pose"
    if np.abs(matrix[:3, 3]).max() > LARGEST_POSITION:
        return None, "implausible_pose"
    if not is_rigid(matrix, POSE_TOLERANCE):
        return None, "non_rigid_pose"
    if is_rigid(matrix, 1e-9):
        return matrix, None
    u, _, right = np.linalg.svd(matrix[:3, :3])
    pose = matrix.copy()
    pose[:3, :3] = u @ right
    return pose, None


def largest_step(poses: np.ndarray) -> float:
    """Return the largest distance [m] between the camera centres of consecutive poses (N, 4, 4)."""
    if len(poses) < 2:
        return 0.0
    return float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max())

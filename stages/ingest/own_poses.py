"""Somebody's own trajectory in place of the poses of a log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.ingest.folders.pose_files import Pose, pose_file, read_pose_list
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses, coverage_notes
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, LogSource

MICROSECOND = 1000
"""[ns]"""


def with_own_poses(source: LogSource, path: Path, parameters: IngestParameters) -> LogSource:
    """Return the log with the poses of a trajectory, a file or a folder that holds one, taken as world_from_camera.

    Lines of TUM's form are looked up at the time of a frame, else at that of its picture; poses with names are of the
    picture that is called so. What the log says of up does not hold in another world. Raises BadInput when no pose is
    of a frame, UsageError for several cameras.
    """
    if len(source.cameras) > 1:
        names = ", ".join(camera.name for camera in source.cameras)
        raise UsageError(f"--trajectory is of one camera, and {names} are chosen", hint="add --camera NAME")
    file = path if path.is_file() else pose_file(path) if path.is_dir() else None
    if file is None:
        raise BadInput(f"{path}: there is no trajectory", hint="give a file of lines `t tx ty tz qx qy qz qw`")
    found = read_pose_list(file, [_name_of(entry) for entry in source.entries])
    notes: tuple[str, ...] = (f"poses from {file.name}, by option, taken as world_from_camera",)
    if isinstance(found, StampedPoses):
        poses: list[Pose] = [(_pose_at(found, entry, parameters), None) for entry in source.entries]
        times, posed = [round(entry.time * 1e9) for entry in source.entries], [pose is not None for pose, _ in poses]
        covered = coverage_notes(found, times, posed, parameters)
        if not any(posed):
            reason = "; ".join(covered).removeprefix("WARNING: ") or f"{file.name} holds no poses"
            raise BadInput(f"{file}: {reason}", hint="its stamps must be of the clock of the images")
        notes = (*notes, *found.notes, *covered)
    else:
        poses = found
    entries = tuple(
        replace(entry, world_from_camera=pose, problem=entry.problem or problem)
        for entry, (pose, problem) in zip(source.entries, poses, strict=True)
    )
    return replace(
        source, entries=entries, notes=(*source.notes, *notes), world_up="unknown", world_up_detail="", up_in_log=None
    )


def _name_of(entry: Entry) -> str:
    picture = entry.files.color or entry.files.depth
    return entry.name if picture is None else picture.stem


def _pose_at(poses: StampedPoses, entry: Entry, parameters: IngestParameters) -> np.ndarray | None:
    """Return the pose at the time of a frame, which float seconds have to a microsecond, else at its picture's."""
    time = round(entry.time * 1e9)
    stamp = time if entry.stamp is None else entry.stamp
    first, second = (stamp, time) if abs(stamp - time) < MICROSECOND else (time, stamp)
    pose = poses.at(first, parameters)
    return poses.at(second, parameters) if pose is None else pose

"""The poses of frames by a trajectory: one that a step made, or somebody's own, whose world is made upright first."""

from __future__ import annotations

import logging

import numpy as np
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.stamps import spans_text
from scenewright.stages.kit.formats.trajectories import StampedRows, poses_at, read_stamped_rows, read_tum
from scenewright.stages.kit.geometry.surface_samples import surface_samples
from scenewright.stages.kit.geometry.upright_world import make_upright

LINES = "trajectory.tum"
FLOOR_SEED = 0
"""Of the search for the floor: whatever the seed of a step, all steps make the same world of a trajectory."""
UPRIGHT_FRAMES = 60
"""Frames whose depth is looked at to find the floor, as `ingest` looks at."""

logger = logging.getLogger("scenewright")


def frame_poses(
    trajectory: Artifact, sequence: Sequence, reader: FrameReader, tolerance: float
) -> list[np.ndarray | None]:
    """Return the pose of each frame (4, 4), the nearest in time if it is at most `tolerance` [s] off, or None.

    Somebody's own trajectory is of the main camera, in a world of its own, which is made upright as `ingest` does with
    a log's; a line says so. Raises BadInput when none of its poses is of a frame.
    """
    if trajectory.manifest is not None or not isinstance(trajectory, Trajectory) or trajectory.info is not None:
        return poses_at(reader.times, *read_tum(trajectory.path(LINES)), tolerance)
    rows = read_stamped_rows(trajectory.path(LINES))
    main = reader.camera_names[0] if len(reader) else ""
    nearest = zip(_nearest(rows, sequence, reader, tolerance), reader.camera_names, strict=True)
    poses = [pose if name == main else None for pose, name in nearest]
    used = [k for k, pose in enumerate(poses) if pose is not None]
    for note in rows.notes:
        (logger.warning if note.startswith("WARNING") else logger.info)("%s", note)
    if not used:
        spans = spans_text(reader.stamps, rows.stamps) if len(rows.stamps) and len(reader) else "it holds none"
        raise BadInput(
            f"{trajectory.root}: none of its {len(rows.stamps)} poses is of one of the {len(reader)} frames: {spans}",
            hint="write its stamps in the clock of the frames",
        )
    upright = make_upright(
        "auto",
        "z",
        None,
        np.array([poses[k] for k in used]),
        lambda: _surface(reader, poses, used),
        np.random.default_rng(FLOOR_SEED),
    )
    logger.info(
        "%s: %d of %d frames have a pose; its world made upright, %s: %s",
        trajectory.root,
        len(used),
        len(reader),
        upright.method,
        upright.detail,
    )
    world_from_own = np.array(upright.world_from_log)
    return [None if pose is None else world_from_own @ pose for pose in poses]


def _nearest(rows: StampedRows, sequence: Sequence, reader: FrameReader, tolerance: float) -> list[np.ndarray | None]:
    """Return the pose nearest to the time of each frame, else to that which the log states of its picture."""
    stamps, order = np.unique(rows.stamps, return_index=True)
    times = reader.times if sequence.sources is None else sequence.sources.times_beside(reader.times).T
    by_frame, *others = (
        poses_at(column, stamps * 1e-9, rows.poses[order], tolerance) for column in np.atleast_2d(times)
    )
    for other in others:
        by_frame = [pose if pose is not None else second for pose, second in zip(by_frame, other, strict=True)]
    return by_frame


def _surface(reader: FrameReader, poses: list[np.ndarray | None], used: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) and normals (N, 3) that the depth of some frames shows in the trajectory's world."""
    chosen = np.unique(np.linspace(0, len(used) - 1, min(len(used), UPRIGHT_FRAMES)).astype(int))
    samples = [(np.zeros((0, 3)), np.zeros((0, 3)))]
    for index in (used[k] for k in chosen):
        frame, pose = reader.read(index, ("depth",)), poses[index]
        if frame.depth is not None and pose is not None:
            samples.append(surface_samples(frame.depth, reader.cameras[frame.camera_name], pose))
    return np.concatenate([points for points, _ in samples]), np.concatenate([normals for _, normals in samples])

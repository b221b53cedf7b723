"""Putting the estimated path into a world: upright, or where the sequence's own poses are."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Gravity
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.surface_samples import surface_samples
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.geometry.upright_world import make_upright

FLOOR_FRAMES = 40
"""Frames whose depth is looked at to find the floor."""
World = Literal["upright", "sequence", "first"]


def laid_onto(estimated: np.ndarray, given: np.ndarray) -> np.ndarray:
    """Return given_from_estimated (4, 4), the motion that takes estimated poses (N, 4, 4) onto given ones, N >= 1.

    Its rotation is the mean of what the orientations say (chordal mean, Hartley et al. 2013), its translation the mean
    of what the positions then say: unlike an alignment of positions it holds for a camera that only turns.
    """
    rotations = given[:, :3, :3] @ np.swapaxes(estimated[:, :3, :3], 1, 2)
    u, _, vt = np.linalg.svd(rotations.sum(axis=0))
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return transform_from(rotation, (given[:, :3, 3] - estimated[:, :3, 3] @ rotation.T).mean(axis=0))


def without_poses(frames: str, method: str) -> BadInput:
    """Return the error of a world, or of motions to refine, of the sequence that none of the `frames` knows."""
    hint = "use --method rgbd, which needs none" if method == "refine" else "choose --world upright or first"
    return BadInput(f"{frames} has a pose in the sequence", hint=hint)


def choose_world(
    world: str, reader: FrameReader, frames: list[int], poses: np.ndarray, random: np.random.Generator
) -> tuple[World, Gravity]:
    """Return which world was taken and how: `world_from_log` of the result takes the poses (N, 4, 4) into it.

    `frames` (N,) are their indices in the sequence. Raises BadInput when the world of the sequence was asked for and
    none of these frames has a pose there.
    """
    given = given_poses(reader, frames) if world in ("auto", "sequence") else {}
    if given:
        rows = [row for row, frame in enumerate(frames) if frame in given]
        motion = laid_onto(poses[rows], np.array([given[frames[row]] for row in rows]))
        detail = f"laid onto the sequence's own poses of {len(rows)} frames"
        return "sequence", Gravity(method="given", world_from_log=as_transform(motion), detail=detail)
    if world == "sequence":
        raise without_poses("none of the frames that were placed", "")
    if world == "first":
        return "first", Gravity(method="none", world_from_log=as_transform(np.eye(4)), detail="not asked for")

    def cloud() -> tuple[np.ndarray, np.ndarray]:
        chosen = np.unique(np.linspace(0, len(frames) - 1, min(len(frames), FLOOR_FRAMES)).astype(int))
        samples = [(np.zeros((0, 3)), np.zeros((0, 3)))]
        for row in chosen:
            frame = reader.read(frames[row], ("depth",))
            if frame.depth is not None:
                samples.append(surface_samples(frame.depth, reader.cameras[frame.camera_name], poses[row]))
        return np.concatenate([points for points, _ in samples]), np.concatenate([normals for _, normals in samples])

    return "upright", make_upright("auto", "z", None, poses, cloud, random)


def given_poses(reader: FrameReader, frames: list[int]) -> dict[int, np.ndarray]:
    """Return the poses (4, 4) that the sequence has of some of the frames, by frame."""
    poses = ((frame, reader.read(frame, ()).world_from_camera) for frame in frames)
    return {frame: pose for frame, pose in poses if pose is not None}

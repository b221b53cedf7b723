"""Posed pictures of a sequence, as they are learned from."""

from __future__ import annotations

from collections.abc import Sequence as Listing
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.geometry.cameras import scaled, seen_by
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.own_trajectory import frame_poses

DARK = 0.02
"""Mean brightness, of 1, below which a picture shows nothing."""
TIME_TOLERANCE = 0.005
"""A pose of another trajectory belongs to a frame no farther from it than this [s]."""


@dataclass(frozen=True)
class PosedView:
    """One picture with its pose."""

    frame: int
    """Index in the sequence."""
    time: float
    camera_name: str
    camera: Camera
    color: np.ndarray
    """(H, W, 3) float32, 0 to 1."""
    depth: np.ndarray | None
    """(H, W) float32 [m], 0 unknown."""
    camera_from_world: np.ndarray


def posed_frames(
    reader: FrameReader, sequence: Sequence, trajectory: Trajectory | None
) -> list[tuple[int, np.ndarray]]:
    """Return (frame, world_from_camera) of every frame with colour and a pose, by time.

    Raises BadInput where there is no colour, or where fewer than two frames have a pose.
    """
    if "color" not in reader.streams:
        raise BadInput(f"{sequence.root}: its frames have no colour", hint="splats are learned from images")
    if trajectory is None:
        frames, poses = reader.poses()
        posed = list(zip(frames.tolist(), poses, strict=True))
        hint = "estimate them with scenewright poses, and give --trajectory"
    else:
        of_frames = frame_poses(trajectory, sequence, reader, TIME_TOLERANCE)
        posed = [(frame, pose) for frame, pose in enumerate(of_frames) if pose is not None]
        hint = "the trajectory belongs to another sequence"
    if len(posed) < 2:
        raise BadInput(f"{sequence.root}: {len(posed)} frames have a pose, two are needed", hint=hint)
    return posed


def read_view(reader: FrameReader, frame: int, world_from_camera: np.ndarray, width: int) -> PosedView | None:
    """Return a frame at most `width` pixels wide, of its full picture where it has one and is smaller than that; None
    without colour, or where it is dark."""
    frame_read: Frame = reader.read(frame, ("color", "depth"))
    if frame_read.color is None or float(frame_read.color.mean()) < 255 * DARK:
        return None
    color, depth, camera = sharpest(reader, frame_read, width)
    pose = inverse(world_from_camera)
    return PosedView(
        frame, frame_read.time, frame_read.camera_name, camera, color.astype(np.float32) / np.float32(255), depth, pose
    )


def sharpest(reader: FrameReader, frame: Frame, width: int) -> tuple[np.ndarray, np.ndarray | None, Camera]:
    """Return colour (H, W, 3) uint8, depth (H, W) [m] and camera of a frame that has colour, at most `width` wide: of
    its full picture where it has one and is smaller than that, with depth of the nearest pixel."""
    assert frame.color is not None
    color, depth, camera = frame.color, frame.depth, reader.cameras[frame.camera_name]
    picture = reader.read(frame.index, ("picture",)).picture if width > camera.width else None
    if picture is not None:
        full = reader.picture_cameras[frame.camera_name]
        color, depth, camera = picture, None if depth is None else seen_by(depth, camera, full), full
    if width >= camera.width:
        return color, depth, camera
    small = scaled(camera, width / camera.width)
    size = (small.width, small.height)
    if depth is not None:
        depth = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST)
    return cv2.resize(color, size, interpolation=cv2.INTER_AREA), depth, small


def held_out(count: int, every: int) -> list[int]:
    """Return which of `count` posed frames are kept from training: every `every`-th from the middle of the first
    stretch; none for 0."""
    return list(range(every // 2, count, every)) if every else []


def evenly(frames: Listing[int], most: int) -> list[int]:
    """Return at most `most` of the frames, evenly spread; all for 0."""
    if not most or len(frames) <= most:
        return list(frames)
    return [frames[int(k)] for k in np.linspace(0, len(frames) - 1, most).round()]

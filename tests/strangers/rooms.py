"""A room of boxes by ray casting, cameras that strangers hold in it, and how far depth lies off its surfaces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply

from tests.unit.segment.test_box_masks import world_depth

CAMERA = Camera(width=160, height=120, fx=130.0, fy=130.0, cx=79.5, cy=59.5)
ROOM = (np.array([-2.0, -1.5, 0.0]), np.array([2.0, 1.5, 2.4]))
TABLE = (np.array([-0.5, -0.3, 0.0]), np.array([0.5, 0.4, 0.72]))
CUP = (np.array([-0.10, -0.05, 0.72]), np.array([0.06, 0.11, 0.90]))
CABINET = (np.array([1.3, 0.5, 0.0]), np.array([2.0, 1.5, 1.1]))
BIN = (np.array([-1.3, 0.5, 0.0]), np.array([-0.9, 0.9, 0.45]))
SCENE = [ROOM, TABLE, CUP, CABINET, BIN]
NAMES = {1: "wall", 2: "table", 3: "cup", 4: "cabinet", 5: "bin"}
"""Surface number -> class; the room's own surfaces (floor, walls, ceiling) are all 1."""

Shot = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Colour (H, W, 3) uint8, z-depth (H, W) float [m], log_from_camera (4, 4)."""


def pitched(eye: tuple[float, float, float], yaw: float, pitch: float, roll: float = 0.0) -> np.ndarray:
    """Return world_from_camera (OpenCV axes): `pitch` degrees down, `roll` degrees about the line of sight."""
    y, p, r = np.radians([yaw, pitch, roll])
    forward = np.array([np.cos(p) * np.cos(y), np.cos(p) * np.sin(y), -np.sin(p)])
    right = np.array([np.sin(y), -np.cos(y), 0.0])
    down = np.cross(forward, right)
    turned = np.eye(4)
    turned[:3, 0] = np.cos(r) * right + np.sin(r) * down
    turned[:3, 1] = -np.sin(r) * right + np.cos(r) * down
    turned[:3, 2], turned[:3, 3] = forward, eye
    return turned


def path(count: int = 12, pitch: float = 25.0, height: float = 1.5, roll: float = 0.0) -> np.ndarray:
    """Return poses (count, 4, 4) of a walk along the short wall that turns with it."""
    s = np.linspace(0, 1, count)
    return np.array(
        [
            pitched((-1.5 + 0.7 * t, -0.9 + 1.3 * t, height + 0.1 * np.sin(6 * t)), 40 - 55 * t, pitch + 3 * t, roll)
            for t in s
        ]
    )


def painted(points: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return (H, W, 3) uint8: a shade for each surface, and 6 cm cells with corners that features find."""
    cells = np.floor(points / 0.06 + 0.01).astype(np.int64) @ np.array([73856093, 19349663, 83492791])
    noise = (cells * 2654435761 % 1009) / 1009
    shade = np.array([0, 150, 60, 210, 100, 30])[which] + 50 * noise - 25
    return np.stack([np.clip(shade + step, 0, 255) for step in (20, 0, -15)], axis=-1).astype(np.uint8)


def seen(pose: np.ndarray, camera: Camera = CAMERA) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return colour, z-depth (H, W) float [m] and surface numbers (H, W) of one camera."""
    depth, which = world_depth(camera, pose, SCENE)
    points = apply(pose, back_project(depth.astype(np.float32), camera).astype(float))
    return painted(points, which), depth.astype(float), which


def shots(poses: np.ndarray, log_from_world: np.ndarray | None = None, camera: Camera = CAMERA) -> list[Shot]:
    """Return what a recorder has; its world may be another than the room's."""
    log_from_world = np.eye(4) if log_from_world is None else log_from_world
    views = [seen(pose, camera) for pose in poses]
    return [(color, depth, log_from_world @ pose) for (color, depth, _), pose in zip(views, poses, strict=True)]


Y_UP = np.array([[1.0, 0, 0, 0.3], [0, 0, 1.0, -1.4], [0, -1.0, 0, 0.2], [0, 0, 0, 1.0]])
"""log_from_world of phones: y is up, and the origin is where the phone was switched on."""


def off_the_surfaces(points: np.ndarray) -> np.ndarray:
    """Return the distances (N,) of points in the room's frame to the nearest true surface [m], by closed form."""
    distances = []
    for low, high in SCENE:
        outside = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=-1)
        inside = np.minimum(points - low, high - points).min(axis=-1)
        distances.append(np.where(outside > 0, outside, inside))
    return np.min(distances, axis=0)


def depth_error(sequence: Path, poses: np.ndarray, first: int = 0) -> float:
    """Return how far 95 % of all depth points lie off the true surfaces at most [m].

    The first pose is laid on the true one; the others, the depth unit and the intrinsics are the sequence's own.
    """
    with FrameReader(sequence / "frames.mcap") as reader:
        camera = reader.camera
        frames = [(frame.world_from_camera, frame.depth) for frame in reader.frames(streams=("depth",))]
    assert frames[0][0] is not None, "the sequence has no poses"
    room_from_world = poses[first] @ np.linalg.inv(frames[0][0])
    errors = []
    for pose, depth in frames:
        points = back_project(depth, camera).astype(float)[depth > 0]
        errors.append(off_the_surfaces(apply(room_from_world @ pose, points)))
    return float(np.percentile(np.concatenate(errors), 95))


def tilt(sequence: Path, poses: np.ndarray, first: int = 0) -> float:
    """Return the angle between the true up and z of the sequence's world [deg]."""
    with FrameReader(sequence / "frames.mcap") as reader:
        pose = next(iter(reader.frames(streams=()))).world_from_camera
    assert pose is not None, "the sequence has no poses"
    up = pose[:3, :3] @ poses[first][:3, :3].T @ np.array([0.0, 0.0, 1.0])
    return float(np.degrees(np.arccos(np.clip(up[2], -1, 1))))

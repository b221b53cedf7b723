"""A small room with blocks and painted walls, ray cast in numpy, and a camera that walks in a circle and comes back."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Gravity, Sequence, SequenceCamera, SequenceFile
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.transforms import look_at

CAMERA = Camera(width=160, height=120, fx=120.0, fy=120.0, cx=79.5, cy=59.5)
LOW, HIGH = np.array([-2.0, -1.6, 0.0]), np.array([2.0, 1.6, 2.4])
BLOCKS = (
    ((-1.9, -1.5, 0.0), (-1.2, -0.6, 0.8)),
    ((1.0, -0.4, 0.0), (1.9, 0.5, 0.7)),
    ((-0.6, 1.0, 0.0), (0.5, 1.6, 1.1)),
    ((0.3, -1.6, 0.0), (0.9, -1.2, 1.7)),
    ((-2.0, 0.4, 0.0), (-1.5, 1.0, 1.4)),
)


def render(pose: np.ndarray, camera: Camera = CAMERA) -> tuple[np.ndarray, np.ndarray]:
    """Return colour (H, W, 3) uint8 and z-depth (H, W) float32 of the room from `pose` (world_from_camera)."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
    rays, eye = rays @ pose[:3, :3].T, pose[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.maximum((LOW - eye) / rays, (HIGH - eye) / rays).min(axis=-1)
        for low, high in BLOCKS:
            near, far = (np.array(low) - eye) / rays, (np.array(high) - eye) / rays
            enter, leave = np.minimum(near, far).max(axis=-1), np.maximum(near, far).min(axis=-1)
            depth = np.where((enter <= leave) & (enter > 0), np.minimum(depth, enter), depth)
    points = eye + rays * depth[..., None]
    return paint(points), depth.astype(np.float32)


def paint(points: np.ndarray) -> np.ndarray:
    """Return the colour (..., 3) uint8 of surface points: patches of 50 and 16 cm whose grey their place decides."""
    gray = np.full(points.shape[:-1], 40.0)
    for size, contrast in ((0.5, 100.0), (0.16, 100.0)):
        cells = np.floor(points / size + 0.01).astype(np.int64)
        mixed = (cells[..., 0] * 73856093) ^ (cells[..., 1] * 19349663) ^ (cells[..., 2] * 83492791)
        gray += (mixed * 2654435761 % 4294967296) / 4294967296 * contrast
    return np.repeat(gray[..., None], 3, axis=-1).astype(np.uint8)


def round_walk(count: int, turns: float = 1.0) -> np.ndarray:
    """Return poses (count, 4, 4) that go round the middle of the room looking outwards, slightly down."""
    poses = []
    for angle in 2 * np.pi * turns * np.arange(count) / max(count - 1, 1):
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])
        eye = np.array([0.0, 0.0, 1.3]) - 0.3 * outward
        poses.append(look_at(eye, eye + outward + np.array([0.0, 0.0, -0.25])))
    return np.array(poses)


def write_sequence(
    root: Path,
    poses: np.ndarray,
    *,
    with_pose: bool = False,
    given: Iterable[np.ndarray | None] | None = None,
    with_color: bool = True,
    with_depth: bool = True,
    blank: Collection[int] = (),
) -> Sequence:
    """Write a sequence of the room seen from `poses`; the frames in `blank` see black and no depth.

    With `with_pose` it says that they are `given`, by default where they are; None: nowhere.
    """
    said = list(poses if given is None else given)
    root.mkdir(parents=True)
    streams = [name for name, there in (("color", with_color), ("depth", with_depth), ("pose", with_pose)) if there]
    random = np.random.default_rng(0)
    with FrameWriter(root / "frames.mcap", CAMERA, world_up="unknown") as writer:
        for index, (pose, told) in enumerate(zip(poses, said, strict=True)):
            color, depth = render(pose)
            depth += random.normal(0.0, 0.002, depth.shape).astype(np.float32)
            if index in blank:
                color, depth = np.zeros_like(color), np.zeros_like(depth)
            writer.write(
                0.1 * index, color if with_color else None, depth if with_depth else None, told if with_pose else None
            )
    posed = [k for k, told in enumerate(said) if with_pose and told is not None]
    write_tum(root / "trajectory.tum", 0.1 * np.array(posed), np.array([said[k] for k in posed]).reshape(-1, 4, 4))
    SequenceFile(
        source_format="test",
        rule="test",
        camera=CAMERA,
        cameras=(SequenceCamera(name="camera", camera=CAMERA, frame_count=len(poses)),),
        streams=tuple(streams),
        frame_count=len(poses),
        frames_in_log=len(poses),
        gravity=Gravity(method="none", world_from_log=as_transform(np.eye(4))),
    ).write(root / "sequence.json")
    return Sequence(root)

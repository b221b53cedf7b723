"""A small room with exact depth, and writers that record it in every log format that ingest reads."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.trajectories import write_open3d_log
from scenewright.stages.kit.geometry.transforms import look_at, quaternion_of

CAMERA = Camera(width=96, height=72, fx=80.0, fy=80.0, cx=47.5, cy=35.5)
ROOM = (np.array([-2.0, -1.5, 0.0]), np.array([2.0, 1.5, 2.5]))
TABLE = (np.array([-0.6, -0.4, 0.0]), np.array([0.6, 0.4, 0.72]))


def room_depth(camera: Camera, world_from_camera: np.ndarray) -> np.ndarray:
    """Return exact z-depth (H, W) float32 [m] of a room with a solid table, seen from inside."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
    directions = rays @ world_from_camera[:3, :3].T
    origin = world_from_camera[:3, 3]
    with np.errstate(divide="ignore"):
        leave = np.where(directions > 0, (ROOM[1] - origin) / directions, (ROOM[0] - origin) / directions).min(axis=-1)
        near = (TABLE[0] - origin) / directions
        far = (TABLE[1] - origin) / directions
    enter_table, leave_table = np.minimum(near, far).max(axis=-1), np.maximum(near, far).min(axis=-1)
    hits = (enter_table < leave_table) & (enter_table > 0)
    return np.where(hits, enter_table, leave).astype(np.float32)


def camera_poses(count: int) -> np.ndarray:
    """Return world_from_camera (count, 4, 4): a walk along one wall, looking down at the room."""
    steps = np.linspace(0, 1, count)
    return np.array(
        [look_at(np.array([-1.6 + 0.5 * s, -1.3 + 2.2 * s, 1.5]), np.array([0.9, 0.2 - 0.3 * s, 0.35])) for s in steps]
    )


def color_image(index: int, camera: Camera = CAMERA) -> np.ndarray:
    """Return a picture (H, W, 3) uint8 RGB that differs from frame to frame; channels differ strongly."""
    image = np.zeros((camera.height, camera.width, 3), np.uint8)
    image[..., 0] = 200
    image[..., 1] = np.linspace(0, 120, camera.width).astype(np.uint8)
    image[..., 2] = 10 * index
    return image


def millimetres(depth: np.ndarray) -> np.ndarray:
    """Return uint16 millimetres."""
    return np.rint(depth * 1000).astype(np.uint16)


def jpeg(color: np.ndarray) -> bytes:
    """Encode RGB as JPEG."""
    return cv2.imencode(".jpg", color[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


def png(image: np.ndarray) -> bytes:
    """Encode a grey, 16-bit or RGB image as PNG."""
    return cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)[1].tobytes()


def frames(count: int, tilt: np.ndarray | None = None) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return (colour, depth [m], log_from_camera) of `count` frames; `tilt` (4, 4) is log_from_world."""
    tilt = np.eye(4) if tilt is None else tilt
    return [(color_image(i), room_depth(CAMERA, pose), tilt @ pose) for i, pose in enumerate(camera_poses(count))]


def write_seven_scenes(root: Path, recorded: list) -> Path:
    """Write a 7-Scenes folder with an intrinsics file."""
    root.mkdir(parents=True)
    matrix = [[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
    np.savetxt(root / "camera-intrinsics.txt", matrix)
    for index, (color, depth, pose) in enumerate(recorded):
        (root / f"frame-{index:06d}.color.jpg").write_bytes(jpeg(color))
        (root / f"frame-{index:06d}.depth.png").write_bytes(png(millimetres(depth)))
        np.savetxt(root / f"frame-{index:06d}.pose.txt", pose)
    return root


def write_redwood(root: Path, recorded: list) -> Path:
    """Write a Redwood folder with camera_intrinsic.json."""
    (root / "image").mkdir(parents=True)
    (root / "depth").mkdir()
    for index, (color, depth, _) in enumerate(recorded):
        (root / "image" / f"{index:05d}.jpg").write_bytes(jpeg(color))
        (root / "depth" / f"{index:05d}.png").write_bytes(png(millimetres(depth)))
    write_open3d_log(root / "trajectory.log", np.array([pose for _, _, pose in recorded]))
    k = CAMERA
    matrix = [k.fx, 0, 0, 0, k.fy, 0, k.cx, k.cy, 1]
    text = f'{{"width": {k.width}, "height": {k.height}, "intrinsic_matrix": {matrix}}}'
    (root / "camera_intrinsic.json").write_text(text)
    return root


def write_posed_images(root: Path, recorded: list) -> Path:
    """Write color/1.png, depth/1.pgm, pose.txt; file numbers are not padded, so that order matters."""
    (root / "color").mkdir(parents=True)
    (root / "depth").mkdir()
    lines = []
    for index, (color, depth, pose) in enumerate(recorded, start=1):
        (root / "color" / f"{index}.png").write_bytes(png(color))
        image = millimetres(depth)
        header = f"P5 {CAMERA.width} {CAMERA.height} 65535\n".encode()
        (root / "depth" / f"{index}.pgm").write_bytes(header + image.astype(">u2").tobytes())
        lines.append(" ".join(str(float(value)) for value in [*pose[:3, 3], *quaternion_of(pose)]))
    (root / "pose.txt").write_text("\n".join(lines))
    return root

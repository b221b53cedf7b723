"""Pinhole projection and back-projection; z-depth; OpenCV frame (x right, y down, z forward)."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Camera


def intrinsic_matrix(camera: Camera) -> np.ndarray:
    """Return K (3, 3), pixels."""
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]], dtype=float)


def back_project(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return points (H, W, 3) [m] in the camera frame of a z-depth image (H, W) [m]; depth 0 gives the origin."""
    height, width = depth.shape
    x = (np.arange(width, dtype=np.float32) - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (np.arange(height, dtype=np.float32) - np.float32(camera.cy)) / np.float32(camera.fy)
    depth = depth.astype(np.float32)
    return np.stack([x[None, :] * depth, y[:, None] * depth, depth], axis=-1)


def project(points_in_camera: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels (N, 2) and z-depth (N,) [m] of points (N, 3); pixels of points with z <= 0 are NaN."""
    z = points_in_camera[:, 2]
    safe = np.where(z > 0, z, np.nan)
    u = camera.fx * points_in_camera[:, 0] / safe + camera.cx
    v = camera.fy * points_in_camera[:, 1] / safe + camera.cy
    return np.stack([u, v], axis=1), z


def scaled(camera: Camera, factor: float) -> Camera:
    """Return the camera of an image resized by `factor` (pixel centres at integer coordinates)."""
    return Camera(
        width=round(camera.width * factor),
        height=round(camera.height * factor),
        fx=camera.fx * factor,
        fy=camera.fy * factor,
        cx=(camera.cx + 0.5) * factor - 0.5,
        cy=(camera.cy + 0.5) * factor - 0.5,
    )

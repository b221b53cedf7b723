"""Pinhole projection and back-projection; z-depth; OpenCV frame (x right, y down, z forward)."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Camera


def intrinsic_matrix(camera: Camera) -> np.ndarray:
    """Return K (3, 3), pixels."""
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]], dtype=float)


def back_project(depth: np.ndarray, camera: Camera, stride: int = 1) -> np.ndarray:
    """Return points (H, W, 3) [m] in the camera frame of a z-depth image (H, W) [m]; depth 0 gives the origin.

    With a `stride` every so many rows and columns are taken, the first ones among them.
    """
    height, width = depth.shape
    x = (np.arange(0, width, stride, dtype=np.float32) - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (np.arange(0, height, stride, dtype=np.float32) - np.float32(camera.cy)) / np.float32(camera.fy)
    depth = depth[::stride, ::stride].astype(np.float32)
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


def seen_by(image: np.ndarray, source: Camera, target: Camera) -> np.ndarray:
    """Return an image (H, W, ...) of one camera as another at its place, turned like it, sees it (H', W', ...): the
    nearest pixel counts, 0 where the first saw nothing."""
    columns = _looked_up(target.width, target.fx, target.cx, source.fx, source.cx)
    rows = _looked_up(target.height, target.fy, target.cy, source.fy, source.cy)
    inside = np.logical_and.outer((rows >= 0) & (rows < source.height), (columns >= 0) & (columns < source.width))
    found = image[np.clip(rows, 0, source.height - 1)[:, None], np.clip(columns, 0, source.width - 1)]
    return np.where(inside.reshape(*inside.shape, *(1,) * (image.ndim - 2)), found, np.zeros((), image.dtype))


def boxes_seen_by(boxes: np.ndarray, source: Camera, target: Camera) -> np.ndarray:
    """Return boxes (N, 4) x0 y0 x1 y1 [pixel] in the image of one camera in that of another at its place."""
    factors = np.array([target.fx / source.fx, target.fy / source.fy] * 2)
    return (boxes - [source.cx, source.cy] * 2) * factors + [target.cx, target.cy] * 2


def _looked_up(count: int, focal: float, center: float, source_focal: float, source_center: float) -> np.ndarray:
    """Return the nearest pixel of another camera along one axis, of each of `count` pixels."""
    return np.rint((np.arange(count) - center) / focal * source_focal + source_center).astype(int)

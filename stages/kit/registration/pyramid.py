"""What dense alignment sees of a frame: points, normals and brightness at a few resolutions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled

DEPTH_JUMP = 0.04
"""Depths of one surface differ by less than this share within 2x2 pixels, and bend by less along three."""
STEEPEST = 0.6
"""A surface along which the depth changes by more than this share within a normal's reach has no normal."""


class Level(NamedTuple):
    """One resolution of a frame. Compiled functions take it as it is."""

    intrinsics: np.ndarray
    """fx, fy, cx, cy [pixels] of this level."""
    points: np.ndarray
    """(H, W, 3) float32 in the camera [m]; z = 0 where there is no depth."""
    normals: np.ndarray
    """(H, W, 3) float32 unit, towards the camera; 0 where there is none."""
    brightness: np.ndarray
    """(H, W) float32 in [0, 1]; -1 where it is not known, which includes everywhere without colour."""
    gradient: np.ndarray
    """(H, W, 2) float32, change of the brightness per pixel along u and v."""


@dataclass(frozen=True)
class Pyramid:
    """A frame at several resolutions, the finest first."""

    levels: tuple[Level, ...]
    has_color: bool
    depth_share: float
    """Share of the finest level's pixels that have depth."""
    median_depth: float
    """Median depth [m], 0 without any."""


@compiled
def _halve(depth: np.ndarray, jump: float) -> np.ndarray:
    """Return (H // 2, W // 2) means over 2x2 pixels of the surface that is nearest there."""
    height, width = depth.shape[0] // 2, depth.shape[1] // 2
    result = np.zeros((height, width), dtype=np.float32)
    for v in range(height):
        for u in range(width):
            nearest = np.float32(np.inf)
            for k in range(4):
                z = depth[2 * v + k // 2, 2 * u + k % 2]
                if 0 < z < nearest:
                    nearest = z
            if nearest == np.inf:
                continue
            total, count = np.float32(0), 0
            for k in range(4):
                z = depth[2 * v + k // 2, 2 * u + k % 2]
                if z > 0 and z - nearest < jump * nearest:
                    total += z
                    count += 1
            result[v, u] = total / count
    return result


@compiled
def _points_and_normals(
    depth: np.ndarray, intrinsics: np.ndarray, jump: float, reach: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return points and normals (H, W, 3); normals are cross products of differences over `reach` pixels each way."""
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    points = np.zeros((height, width, 3), dtype=np.float32)
    normals = np.zeros((height, width, 3), dtype=np.float32)
    for v in range(height):
        for u in range(width):
            z = depth[v, u]
            points[v, u, 0] = (u - cx) / fx * z
            points[v, u, 1] = (v - cy) / fy * z
            points[v, u, 2] = z
    for v in range(reach, height - reach):
        for u in range(reach, width - reach):
            z = depth[v, u]
            if z <= 0:
                continue
            left_depth, right = depth[v, u - reach], depth[v, u + reach]
            above, below = depth[v - reach, u], depth[v + reach, u]
            if left_depth <= 0 or right <= 0 or above <= 0 or below <= 0:
                continue
            # An edge bends the depth; a floor that is seen at a grazing angle only slants it.
            if abs(left_depth + right - 2 * z) > jump * z or abs(above + below - 2 * z) > jump * z:
                continue
            if abs(right - left_depth) > STEEPEST * z or abs(below - above) > STEEPEST * z:
                continue
            a0 = points[v, u + reach, 0] - points[v, u - reach, 0]
            a1 = points[v, u + reach, 1] - points[v, u - reach, 1]
            a2 = points[v, u + reach, 2] - points[v, u - reach, 2]
            b0 = points[v + reach, u, 0] - points[v - reach, u, 0]
            b1 = points[v + reach, u, 1] - points[v - reach, u, 1]
            b2 = points[v + reach, u, 2] - points[v - reach, u, 2]
            n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
            length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
            if length == 0:
                continue
            if n0 * points[v, u, 0] + n1 * points[v, u, 1] + n2 * z > 0:
                length = -length
            normals[v, u, 0], normals[v, u, 1], normals[v, u, 2] = n0 / length, n1 / length, n2 / length
    return points, normals


def build_pyramid(
    depth: np.ndarray, color: np.ndarray | None, camera: Camera, *, width: int, levels: int, maximum_depth: float
) -> Pyramid:
    """Return the pyramid of a frame.

    `depth` is (H, W) float32 [m], 0 invalid; `color` is (H, W, 3) uint8 RGB or None. The finest level is the frame
    halved until it is at most `width` wide; depth beyond `maximum_depth` [m] is left out.
    """
    depth = np.where(depth <= maximum_depth, depth, np.float32(0)).astype(np.float32)
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    gray = None
    if color is not None:
        gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32) / np.float32(255)
    while depth.shape[1] > width and min(depth.shape) >= 4:
        depth, gray, intrinsics = _half(depth, gray, intrinsics)
    valid = depth > 0
    finest = depth
    built = []
    for number in range(levels):
        if number:
            if min(depth.shape) < 24:
                break  # nothing can be told apart on so few pixels
            depth, gray, intrinsics = _half(depth, gray, intrinsics)
        points, normals = _points_and_normals(depth, intrinsics, DEPTH_JUMP, 2 if number == 0 else 1)
        smooth, gradient = _smoothed(gray, depth.shape)
        built.append(Level(intrinsics, points, normals, smooth, gradient))
    share = float(valid.mean())
    return Pyramid(tuple(built), gray is not None, share, float(np.median(finest[valid])) if share > 0 else 0.0)


def _smoothed(gray: np.ndarray | None, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return brightness (H, W) and its gradient (H, W, 2); -1 and 0 wherever black pixels take part.

    Colour that was resampled into the depth camera is black where the depth has holes: edges that no surface has.
    """
    if gray is None:
        return np.full(shape, -1, dtype=np.float32), np.zeros((*shape, 2), dtype=np.float32)
    smooth = np.asarray(cv2.GaussianBlur(gray, (3, 3), 0))
    along_u = cv2.Scharr(smooth, cv2.CV_32F, 1, 0, scale=1 / 32)
    along_v = cv2.Scharr(smooth, cv2.CV_32F, 0, 1, scale=1 / 32)
    covered = cv2.erode((gray > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    gradient = np.where(covered[..., None], np.stack([along_u, along_v], axis=-1), np.float32(0))
    return np.where(covered, smooth, np.float32(-1)), gradient


def _half(
    depth: np.ndarray, gray: np.ndarray | None, intrinsics: np.ndarray
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    fx, fy, cx, cy = intrinsics
    smaller = _halve(depth, DEPTH_JUMP)
    height, width = smaller.shape
    if gray is not None:
        # The mean of the pixels that are not black.
        covered = (gray > 0).astype(np.float32)
        size, area = (width, height), (slice(2 * height), slice(2 * width))
        share = np.asarray(cv2.resize(covered[area], size, interpolation=cv2.INTER_AREA))
        mean = np.asarray(cv2.resize(gray[area], size, interpolation=cv2.INTER_AREA))
        gray = np.where(share > 0, mean / np.maximum(share, np.float32(0.25)), np.float32(0)).astype(np.float32)
    return smaller, gray, np.array([fx / 2, fy / 2, (cx + 0.5) / 2 - 0.5, (cy + 0.5) / 2 - 0.5])

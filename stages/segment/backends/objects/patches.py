"""Smooth patches of what stands on a support surface: the pieces that objects are put together from.

A patch ends at depth jumps, concave creases and convex creases, so that it is one face of a box, the jacket of a can
or the inside of a bowl. What ends nowhere in the depth (boxes that stand flush) is cut later.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import prange
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.support import (
    SupportSettings,
    SupportSurface,
    find_supports,
    ray_slopes,
)
from scenewright.stages.segment.geometric import label_regions, pixels_at, smooth_depth
from scenewright.stages.segment.normals import surface_normals

Window = tuple[slice, slice]
NORMAL_DISTANCE = 0.02
"""Points farther away than this share of the depth take no part in a normal."""
WINDOW_GRID = 12
"""Windows begin at multiples of this, so that what looks at every n-th pixel meets the same ones in every window."""


@dataclass(frozen=True)
class PatchSettings:
    """Constants of the patches; pixel counts hold for 640x480."""

    smoothing_window: int = 7
    smoothing_deviation: float = 0.009
    normal_window: int = 9
    normal_step: int = 2
    crease_window: int = 5
    concave_cosine: float = 0.97
    convex_cosine: float = 0.88
    jump: float = 0.012
    """Neighbours farther apart than this share of the depth are not connected."""
    minimum_pixels: int = 60
    smallest_island: int = 150
    """Connected pixels over the surface that are fewer than this are noise."""


@dataclass(frozen=True)
class PatchFrame:
    """Patches of one frame with what was computed on the way, in the window that holds all foreground."""

    window: Window
    """Rows and columns of the image that the arrays are of, (h, w) in size."""
    labels: np.ndarray
    """(h, w) int32, 0 = none, else 1..n."""
    points: np.ndarray
    """(h, w, 3) float32 [m], camera frame, of the smoothed depth."""
    normals: np.ndarray
    """(h, w, 3) float32, zero off the patches."""
    inverse: np.ndarray
    """(h, w) float32 inverse of the smoothed depth [1/m], 0 without depth."""
    supports: list[SupportSurface]
    height: np.ndarray
    """(h, w) float32 [m] over the largest support surface, 0 without one."""


def foreground_of(
    inverse: np.ndarray, camera: Camera, supports: list[SupportSurface], settings: SupportSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Return (foreground (H, W) bool, height over the largest surface (H, W) float32 [m]).

    `inverse` (H, W) float32 [1/m], 0 invalid. A pixel is foreground when it has depth, belongs to no support surface,
    and does not lie behind the largest one.
    """
    foreground = inverse > 0
    height = np.zeros_like(inverse)
    x, y = ray_slopes(camera)
    for k, surface in enumerate(supports):
        coefficients = surface.coefficients.astype(np.float32)
        limits = np.array([surface.offset, settings.clearance, settings.height], dtype=np.float32)
        _take_surface(foreground, height, inverse, x, y, coefficients, limits, k == 0)
    return foreground, height


@compiled
def _take_surface(
    foreground: np.ndarray,
    height: np.ndarray,
    inverse: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    coefficients: np.ndarray,
    limits: np.ndarray,
    largest: bool,
) -> None:
    """Take what lies on a surface, and behind the largest one, out of the foreground (H, W) bool; write the height
    (H, W) [m] over the largest one. `limits` (3,) float32: the surface's offset [m], clearance [1/m], height [m]."""
    a, b, c, d, e, f = coefficients
    offset, clearance, lowest = limits
    column_part = a + b * x + d * x * x
    row_part = c * y + f * y * y
    for v in range(inverse.shape[0]):
        slope = e * y[v]
        for u in range(inverse.shape[1]):
            if not (foreground[v, u] or (largest and inverse[v, u] > 0)):
                continue
            over = inverse[v, u] - (column_part[u] + row_part[v] + slope * x[u])
            metres = offset * over / max(inverse[v, u], np.float32(1e-3))
            if largest:
                height[v, u] = metres
            on_it = over < clearance or metres < lowest
            if on_it and (largest or over > -clearance * 2):
                foreground[v, u] = False


@compiled(parallel=True)
def _edges(
    points: np.ndarray,
    normals: np.ndarray,
    foreground: np.ndarray,
    window: int,
    concave_cosine: float,
    convex_cosine: float,
    jump: float,
) -> np.ndarray:
    """True on creases, on jumps between foreground pixels, and off the foreground."""
    height, width = foreground.shape
    edges = np.ones((height, width), dtype=np.bool_)
    half = window // 2
    for v in prange(height):
        for u in range(width):
            if not foreground[v, u]:
                continue
            nx, ny, nz = normals[v, u, 0], normals[v, u, 1], normals[v, u, 2]
            if nx == 0.0 and ny == 0.0 and nz == 0.0:
                continue
            px, py, pz = points[v, u, 0], points[v, u, 1], points[v, u, 2]
            edge = False
            for row in range(max(0, v - half), min(height, v + half + 1)):
                for column in range(max(0, u - half), min(width, u + half + 1)):
                    if edge:
                        break
                    if not foreground[row, column]:
                        continue
                    dz = points[row, column, 2] - pz
                    far = abs(dz) > jump * pz
                    if far and (abs(row - v) > 1 or abs(column - u) > 1):
                        continue
                    mx, my, mz = normals[row, column, 0], normals[row, column, 1], normals[row, column, 2]
                    cosine = mx * nx + my * ny + mz * nz
                    if not far and cosine >= concave_cosine and cosine >= convex_cosine:
                        continue
                    dx = points[row, column, 0] - px
                    dy = points[row, column, 1] - py
                    along_p = dx * nx + dy * ny + dz * nz
                    along_q = dx * mx + dy * my + dz * mz
                    if far:
                        # A surface seen at a grazing angle changes its depth fast without ending.
                        if abs(along_p) > 0.5 * jump * pz and abs(along_q) > 0.5 * jump * pz:
                            edge = True
                    elif cosine < (concave_cosine if along_p - along_q > 0.0005 else convex_cosine):
                        edge = True
                if edge:
                    break
            edges[v, u] = edge
    return edges


def find_patches(
    depth: np.ndarray,
    camera: Camera,
    settings: PatchSettings | None = None,
    support_settings: SupportSettings | None = None,
) -> PatchFrame:
    """Return the smooth patches over the support surfaces of a z-depth image (H, W) [m], 0 invalid."""
    settings, support_settings = settings or PatchSettings(), support_settings or SupportSettings()
    depth = np.ascontiguousarray(depth, dtype=np.float32)
    if settings.smoothing_window:
        depth = smooth_depth(depth, window=settings.smoothing_window, deviation=settings.smoothing_deviation)
    inverse = reciprocal(depth)
    supports = find_supports(depth, camera, support_settings)
    foreground, height = foreground_of(inverse, camera, supports, support_settings)
    risen = (height > support_settings.rise) | (not supports)
    foreground = _islands(foreground, risen, pixels_at(settings.smallest_island, depth.shape))
    # All that follows costs time by the pixel, and most pixels show the table.
    window = _window_of(foreground)
    foreground, inverse, height = (np.ascontiguousarray(a[window]) for a in (foreground, inverse, height))
    x, y = ray_slopes(camera)
    points, standing = _points(depth[window], foreground, y[window[0]], x[window[1]])
    # The surface takes no part in the normals beside it.
    normals = surface_normals(
        standing, window=settings.normal_window, step=settings.normal_step, distance_factor=NORMAL_DISTANCE
    )
    edges = _edges(
        points,
        normals,
        foreground,
        settings.crease_window,
        settings.concave_cosine,
        settings.convex_cosine,
        settings.jump,
    )
    labels = label_regions(
        edges, standing, normals, minimum_pixels=pixels_at(settings.minimum_pixels, depth.shape), ratio=settings.jump
    )
    return PatchFrame(window, labels, points, normals, inverse, supports, height)


@compiled
def reciprocal(depth: np.ndarray) -> np.ndarray:
    """Return 1 / depth (H, W) float32, 0 where the depth (H, W) float32 is 0."""
    result = np.zeros(depth.shape, dtype=np.float32)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            if depth[v, u] > 0:
                result[v, u] = np.float32(1) / depth[v, u]
    return result


@compiled
def _points(depth: np.ndarray, foreground: np.ndarray, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (h, w, 3) of a depth image, y / z of every row and x / z of every column; the second time without those
    off the foreground."""
    height, width = depth.shape
    points = np.empty((height, width, 3), dtype=np.float32)
    standing = np.zeros((height, width, 3), dtype=np.float32)
    for v in range(height):
        for u in range(width):
            z = depth[v, u]
            points[v, u, 0], points[v, u, 1], points[v, u, 2] = x[u] * z, y[v] * z, z
            if foreground[v, u]:
                standing[v, u] = points[v, u]
    return points, standing


def _window_of(mask: np.ndarray) -> Window:
    """The rows and columns that hold a mask (H, W) bool, and at least one more to every side that has one."""
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    if len(rows) == 0:
        return slice(0, 1), slice(0, 1)
    top, left = (max(0, int(k[0]) - 1) // WINDOW_GRID * WINDOW_GRID for k in (rows, columns))
    return slice(top, int(rows[-1]) + 2), slice(left, int(columns[-1]) + 2)


def _islands(mask: np.ndarray, risen: np.ndarray, smallest: int) -> np.ndarray:
    """The connected parts of a mask (H, W) bool that have `smallest` pixels, a third of which are `risen`."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=4)
    keep = statistics[:, cv2.CC_STAT_AREA] >= smallest
    high = np.bincount(labels[mask & risen], minlength=count)
    keep &= high >= np.maximum(1, statistics[:, cv2.CC_STAT_AREA] / 3)
    keep[0] = False
    islands: np.ndarray = keep[labels]
    return islands

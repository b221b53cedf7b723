"""Depth carried into another camera: what is in front hides what is behind, and surfaces keep no holes.

Neighbouring depth pixels on one surface span two triangles, which are drawn with inverse depth interpolated (exact for
planes) into a z-buffer of the other camera. Pixels at the rim of a surface, which span no triangle on some side, are
drawn as the square that they cover.
"""

from __future__ import annotations

import math

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.formats.foxglove import depth_to_millimetres, millimetres_to_depth

RELATIVE_STEP = 0.05
"""Depth change between neighbouring pixels, relative to depth, that a slanted surface explains."""
STRAIGHTNESS = 0.005
"""Change of slope of inverse depth, relative to inverse depth, that a plane explains: none but for noise."""
NEAREST = 1e-3
"""Points nearer to the other camera than this [m] are behind it for all we know."""


def registered_depth(
    millimetres: np.ndarray, depth_camera: Camera, target_camera: Camera, target_from_depth: np.ndarray
) -> np.ndarray:
    """Return depth (H', W') uint16 [mm] as `target_camera` sees it, of depth (H, W) uint16 [mm] of `depth_camera`.

    `target_from_depth` is (4, 4). Pixels that see nothing the depth camera saw are 0. z-depth in both.
    """
    depth = millimetres_to_depth(millimetres)
    intrinsics = np.array([depth_camera.fx, depth_camera.fy, depth_camera.cx, depth_camera.cy])
    target = np.array([target_camera.fx, target_camera.fy, target_camera.cx, target_camera.cy])
    inverse_depth = np.zeros((target_camera.height, target_camera.width), np.float64)
    _draw(depth.astype(np.float64), intrinsics, target, np.asarray(target_from_depth, np.float64), inverse_depth)
    depth_in_color = np.divide(1.0, inverse_depth, out=np.zeros_like(inverse_depth), where=inverse_depth > 0)
    return depth_to_millimetres(depth_in_color)


@compiled
def _draw(
    depth: np.ndarray, intrinsics: np.ndarray, target: np.ndarray, motion: np.ndarray, inverse_depth: np.ndarray
) -> None:
    """Draw every depth pixel into the buffer of largest inverse depth [1/m]."""
    height, width = depth.shape
    u = np.full((height, width), np.nan)
    v = np.full((height, width), np.nan)
    w = np.zeros((height, width))
    for row in range(height):
        for column in range(width):
            if depth[row, column] > 0:
                u[row, column], v[row, column], w[row, column] = _reproject(
                    column, row, depth[row, column], intrinsics, target, motion
                )
    spans = _cells_on_one_surface(depth, w)
    for row in range(height):
        for column in range(width):
            if not w[row, column] > 0:
                continue
            if not (
                spans[row, column] and spans[row, column + 1] and spans[row + 1, column] and spans[row + 1, column + 1]
            ):
                _draw_square(depth[row, column], row, column, intrinsics, target, motion, inverse_depth)
            if spans[row + 1, column + 1]:
                a, b = row + 1, column + 1
                _draw_triangle(
                    u[row, column],
                    v[row, column],
                    w[row, column],
                    u[row, b],
                    v[row, b],
                    w[row, b],
                    u[a, column],
                    v[a, column],
                    w[a, column],
                    inverse_depth,
                )
                _draw_triangle(
                    u[a, b],
                    v[a, b],
                    w[a, b],
                    u[row, b],
                    v[row, b],
                    w[row, b],
                    u[a, column],
                    v[a, column],
                    w[a, column],
                    inverse_depth,
                )


@compiled
def _reproject(
    column: float, row: float, z: float, intrinsics: np.ndarray, target: np.ndarray, motion: np.ndarray
) -> tuple[float, float, float]:
    """Return pixel and inverse depth [1/m] in the other camera; inverse depth 0 when the point is not before it."""
    x = (column - intrinsics[2]) / intrinsics[0] * z
    y = (row - intrinsics[3]) / intrinsics[1] * z
    moved_z = motion[2, 0] * x + motion[2, 1] * y + motion[2, 2] * z + motion[2, 3]
    if moved_z < NEAREST:
        return math.nan, math.nan, 0.0
    moved_x = motion[0, 0] * x + motion[0, 1] * y + motion[0, 2] * z + motion[0, 3]
    moved_y = motion[1, 0] * x + motion[1, 1] * y + motion[1, 2] * z + motion[1, 3]
    return target[0] * moved_x / moved_z + target[2], target[1] * moved_y / moved_z + target[3], 1.0 / moved_z


@compiled
def _cells_on_one_surface(depth: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return (H + 1, W + 1): whether the four pixels that meet in the corner above and left of a pixel lie on one
    surface. The outer rim is False."""
    height, width = depth.shape
    inverse = np.zeros((height, width))
    for row in range(height):
        for column in range(width):
            if w[row, column] > 0:
                inverse[row, column] = 1.0 / depth[row, column]
    right = np.zeros((height, width), np.bool_)
    down = np.zeros((height, width), np.bool_)
    for row in range(height):
        for column in range(width):
            if column + 1 < width:
                before = inverse[row, column - 1] if column > 0 else 0.0
                after = inverse[row, column + 2] if column + 2 < width else 0.0
                right[row, column] = _is_one_surface(before, inverse[row, column], inverse[row, column + 1], after)
            if row + 1 < height:
                before = inverse[row - 1, column] if row > 0 else 0.0
                after = inverse[row + 2, column] if row + 2 < height else 0.0
                down[row, column] = _is_one_surface(before, inverse[row, column], inverse[row + 1, column], after)
    spans = np.zeros((height + 1, width + 1), np.bool_)
    for row in range(height - 1):
        for column in range(width - 1):
            spans[row + 1, column + 1] = (
                right[row, column] and right[row + 1, column] and down[row, column] and down[row, column + 1]
            )
    return spans


@compiled
def _is_one_surface(before: float, first: float, second: float, after: float) -> bool:
    """Whether of four inverse depths in a row (0: invalid) the middle two lie on one surface: near to each other, or
    on a line with a third."""
    if not (first > 0 and second > 0):
        return False
    largest = max(first, second)
    if abs(second - first) <= RELATIVE_STEP * largest:
        return True
    if before > 0 and abs(second - 2.0 * first + before) <= STRAIGHTNESS * largest:
        return True
    return after > 0 and abs(after - 2.0 * second + first) <= STRAIGHTNESS * largest


@compiled
def _draw_triangle(
    u0: float,
    v0: float,
    w0: float,
    u1: float,
    v1: float,
    w1: float,
    u2: float,
    v2: float,
    w2: float,
    buffer: np.ndarray,
) -> None:
    """Draw a triangle; pixel centres on its rim belong to it."""
    area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
    if abs(area) < 1e-12:
        return
    first_row, last_row = _pixels(min(v0, v1, v2), max(v0, v1, v2), buffer.shape[0])
    first_column, last_column = _pixels(min(u0, u1, u2), max(u0, u1, u2), buffer.shape[1])
    scale, rim = 1.0 / area, -1e-9
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            share1 = ((column - u0) * (v2 - v0) - (u2 - u0) * (row - v0)) * scale
            share2 = ((u1 - u0) * (row - v0) - (column - u0) * (v1 - v0)) * scale
            if share1 >= rim and share2 >= rim and share1 + share2 <= 1.0 - rim:
                value = w0 + share1 * (w1 - w0) + share2 * (w2 - w0)
                if value > buffer[row, column]:
                    buffer[row, column] = value


@compiled
def _draw_square(
    z: float, row: int, column: int, intrinsics: np.ndarray, target: np.ndarray, motion: np.ndarray, buffer: np.ndarray
) -> None:
    """Draw the square that a single pixel covers, at its depth, as two triangles."""
    u = np.empty(4)
    v = np.empty(4)
    w = np.empty(4)
    for corner in range(4):
        right, down = corner % 2 - 0.5, corner // 2 - 0.5
        u[corner], v[corner], w[corner] = _reproject(column + right, row + down, z, intrinsics, target, motion)
        if not w[corner] > 0:
            return
    _draw_triangle(u[0], v[0], w[0], u[1], v[1], w[1], u[2], v[2], w[2], buffer)
    _draw_triangle(u[3], v[3], w[3], u[1], v[1], w[1], u[2], v[2], w[2], buffer)


@compiled
def _pixels(lowest: float, highest: float, size: int) -> tuple[int, int]:
    """Return the first and last whole pixel within [lowest, highest] and the image; the last is smaller when none."""
    if highest < 0 or lowest > size - 1:
        return 0, -1
    return int(math.ceil(max(lowest - 1e-9, 0.0))), int(math.floor(min(highest + 1e-9, size - 1.0)))

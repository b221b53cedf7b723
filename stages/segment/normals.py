"""Surface normals of a depth image: principal component analysis over a window, without crossing depth edges."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from schemas.scene_parts import Camera
from stages.kit.geometry.cameras import back_project


@njit(cache=True, inline="always")
def _smallest_eigenvector(
    xx: float, xy: float, xz: float, yy: float, yz: float, zz: float
) -> tuple[float, float, float, float]:
    """Unit eigenvector of the smallest eigenvalue of a symmetric 3x3 matrix, and the smallest over the largest
    eigenvalue; (0, 0, 0, 1) when it has no preferred direction. Closed form (Smith 1961)."""
    mean = (xx + yy + zz) / 3.0
    off_diagonal = xy * xy + xz * xz + yz * yz
    spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2.0 * off_diagonal
    if spread <= 0.0:
        return 0.0, 0.0, 0.0, 1.0
    scale = math.sqrt(spread / 6.0)
    a, b, c = (xx - mean) / scale, (yy - mean) / scale, (zz - mean) / scale
    d, e, f = xy / scale, xz / scale, yz / scale
    half_determinant = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    angle = math.acos(min(1.0, max(-1.0, half_determinant))) / 3.0
    smallest = mean + 2.0 * scale * math.cos(angle + 2.0 * math.pi / 3.0)
    largest = mean + 2.0 * scale * math.cos(angle)
    # Rows of (C - smallest I) span the plane normal to the eigenvector: take the longest of their cross products.
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    x0, y0, z0 = xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy
    x1, y1, z1 = xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz
    x2, y2, z2 = b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz
    n0, n1, n2 = x0 * x0 + y0 * y0 + z0 * z0, x1 * x1 + y1 * y1 + z1 * z1, x2 * x2 + y2 * y2 + z2 * z2
    if n1 > n0 and n1 >= n2:
        x0, y0, z0, n0 = x1, y1, z1, n1
    elif n2 > n0:
        x0, y0, z0, n0 = x2, y2, z2, n2
    if n0 <= 0.0 or largest <= 0.0:
        return 0.0, 0.0, 0.0, 1.0
    length = math.sqrt(n0)
    return x0 / length, y0 / length, z0 / length, max(0.0, smallest) / largest


@njit(cache=True, parallel=True)
def _window_normals(points: np.ndarray, window: int, step: int, distance_factor: float) -> np.ndarray:
    height, width = points.shape[0], points.shape[1]
    normals = np.zeros((height, width, 3), dtype=np.float32)
    half = (window // 2) // step * step
    for v in prange(height):
        for u in range(width):
            z = points[v, u, 2]
            if z <= 0.0:
                continue
            px, py, pz = points[v, u, 0], points[v, u, 1], z
            reach = (distance_factor * z) ** 2
            count = 0
            sx = sy = sz = 0.0
            xx = xy = xz = yy = yz = zz = 0.0
            for dv in range(-half, half + 1, step):
                row = v + dv
                if row < 0 or row >= height:
                    continue
                for du in range(-half, half + 1, step):
                    column = u + du
                    if column < 0 or column >= width:
                        continue
                    if points[row, column, 2] <= 0.0:
                        continue
                    x = np.float64(points[row, column, 0] - px)
                    y = np.float64(points[row, column, 1] - py)
                    w = np.float64(points[row, column, 2] - pz)
                    if x * x + y * y + w * w > reach:
                        continue
                    count += 1
                    sx += x
                    sy += y
                    sz += w
                    xx += x * x
                    xy += x * y
                    xz += x * w
                    yy += y * y
                    yz += y * w
                    zz += w * w
            if count < 4:
                continue
            mx, my, mz = sx / count, sy / count, sz / count
            nx, ny, nz, _ = _smallest_eigenvector(
                xx / count - mx * mx,
                xy / count - mx * my,
                xz / count - mx * mz,
                yy / count - my * my,
                yz / count - my * mz,
                zz / count - mz * mz,
            )
            if nx * px + ny * py + nz * pz > 0.0:
                nx, ny, nz = -nx, -ny, -nz
            normals[v, u, 0] = nx
            normals[v, u, 1] = ny
            normals[v, u, 2] = nz
    return normals


def surface_normals(
    points: np.ndarray, *, window: int = 13, step: int = 2, distance_factor: float = 0.05
) -> np.ndarray:
    """Return unit normals (H, W, 3) float32 that face the camera, zero where there is none.

    `points` (H, W, 3) float32 [m] in the camera frame, z <= 0 invalid (back_project). Every normal is the direction
    of least variance of the points in a `window` x `window` pixel neighbourhood that lie within
    `distance_factor` x z of the middle one (Furrer et al. 2018, "depth window filter"; window 13 and factor 0.05 are
    the constants of Han 2024). `step` looks at every step-th row and column of the window alone: 2 is four times
    as fast and moves the normals of noisy depth by about a degree.
    """
    return _window_normals(np.ascontiguousarray(points, dtype=np.float32), window, step, distance_factor)


def normals_of_depth(depth: np.ndarray, camera: Camera, *, window: int = 13, step: int = 2) -> np.ndarray:
    """Return `surface_normals` of a z-depth image (H, W) [m] with 0 invalid."""
    return surface_normals(back_project(depth, camera), window=window, step=step)

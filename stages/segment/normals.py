"""Surface normals of a depth image: principal component analysis over a window, without crossing depth edges."""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from scenewright.stages.kit.compiled import compiled

# A row is worked on in loops without branches over arrays of their own, which add several pixels at a time; every sum
# takes its terms in the order of the window, so that how many are added at a time changes no bit.


@compiled(error_model="numpy")
def _steps_to(
    there: tuple[np.ndarray, np.ndarray, np.ndarray],
    here: tuple[np.ndarray, np.ndarray, np.ndarray],
    reach: np.ndarray,
    count: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
) -> None:
    """Write the steps (N,) from the pixels of a row to a neighbour of each into x, y, z, 0 where it is out of `reach`
    (squared) or no point; `count` those that are within."""
    there_x, there_y, there_z = there
    here_x, here_y, here_z = here
    for k in range(len(reach)):
        dx = np.float64(there_x[k] - here_x[k])
        dy = np.float64(there_y[k] - here_y[k])
        dz = np.float64(there_z[k] - here_z[k])
        left_out = (dx * dx + dy * dy + dz * dz > reach[k]) | (there_z[k] <= np.float32(0.0))
        weight = np.float64(0.0) if left_out else np.float64(1.0)
        count[k] += weight
        x[k] = weight * dx
        y[k] = weight * dy
        z[k] = weight * dz


@compiled(error_model="numpy")
def _add(x: np.ndarray, y: np.ndarray, z: np.ndarray, sx: np.ndarray, sy: np.ndarray, sz: np.ndarray) -> None:
    for k in range(len(x)):
        sx[k] += x[k]
        sy[k] += y[k]
        sz[k] += z[k]


@compiled(error_model="numpy")
def _add_products(x: np.ndarray, y: np.ndarray, z: np.ndarray, xx: np.ndarray, xy: np.ndarray, xz: np.ndarray) -> None:
    for k in range(len(x)):
        xx[k] += x[k] * x[k]
        xy[k] += x[k] * y[k]
        xz[k] += x[k] * z[k]


@compiled(error_model="numpy")
def _add_other_products(y: np.ndarray, z: np.ndarray, yy: np.ndarray, yz: np.ndarray, zz: np.ndarray) -> None:
    for k in range(len(y)):
        yy[k] += y[k] * y[k]
        yz[k] += y[k] * z[k]
        zz[k] += z[k] * z[k]


@compiled(error_model="numpy")
def _covariances(count: np.ndarray, sums: np.ndarray, scale: np.ndarray, determinant: np.ndarray) -> None:
    """Turn the six products in `sums` (9, N) into covariances, and leave their mean in `sums[0]`; `scale` (N,) is 0
    where nothing varies, `determinant` (N,) half of that of the scaled matrix (Smith 1961)."""
    for k in range(len(count)):
        n = count[k]
        mx, my, mz = sums[0, k] / n, sums[1, k] / n, sums[2, k] / n
        xx, xy, xz = sums[3, k] / n - mx * mx, sums[4, k] / n - mx * my, sums[5, k] / n - mx * mz
        yy, yz, zz = sums[6, k] / n - my * my, sums[7, k] / n - my * mz, sums[8, k] / n - mz * mz
        mean = (xx + yy + zz) / 3.0
        off_diagonal = xy * xy + xz * xz + yz * yz
        spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2.0 * off_diagonal
        s = np.sqrt(spread / 6.0)
        a, b, c = (xx - mean) / s, (yy - mean) / s, (zz - mean) / s
        d, e, f = xy / s, xz / s, yz / s
        determinant[k] = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
        scale[k] = s if spread > 0.0 else 0.0
        sums[0, k] = mean
        sums[3, k], sums[4, k], sums[5, k], sums[6, k], sums[7, k], sums[8, k] = xx, xy, xz, yy, yz, zz


@compiled(error_model="numpy")
def _smallest_eigenvalues(scale: np.ndarray, determinant: np.ndarray, sums: np.ndarray) -> None:
    """Put the smallest eigenvalue of every covariance into `sums[1]`, in closed form (Smith 1961); `scale` becomes 0
    where the largest is not positive."""
    for k in range(len(scale)):
        if scale[k] == 0.0:
            continue
        angle = math.acos(min(1.0, max(-1.0, determinant[k]))) / 3.0
        sums[1, k] = sums[0, k] + 2.0 * scale[k] * math.cos(angle + 2.0 * math.pi / 3.0)
        if sums[0, k] <= 0.0 and sums[0, k] + 2.0 * scale[k] * math.cos(angle) <= 0.0:  # where the mean is, it is
            scale[k] = 0.0


@compiled(error_model="numpy")
def _directions(
    px: np.ndarray, py: np.ndarray, pz: np.ndarray, scale: np.ndarray, sums: np.ndarray, normals: np.ndarray
) -> None:
    """Write the eigenvectors of the smallest eigenvalues into `normals` (N, 3), facing the camera, 0 where `scale` is.

    Rows of (C - smallest I) span the plane normal to the eigenvector: the longest of their cross products is taken.
    """
    for k in range(len(scale)):
        xx, xy, xz, yy, yz, zz = sums[3, k], sums[4, k], sums[5, k], sums[6, k], sums[7, k], sums[8, k]
        smallest = sums[1, k]
        a, b, c = xx - smallest, yy - smallest, zz - smallest
        x0, y0, z0 = xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy
        x1, y1, z1 = xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz
        x2, y2, z2 = b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz
        n0, n1, n2 = x0 * x0 + y0 * y0 + z0 * z0, x1 * x1 + y1 * y1 + z1 * z1, x2 * x2 + y2 * y2 + z2 * z2
        second = (n1 > n0) & (n1 >= n2)
        third = (n2 > n0) & ~second
        x = x1 if second else (x2 if third else x0)
        y = y1 if second else (y2 if third else y0)
        z = z1 if second else (z2 if third else z0)
        n = n1 if second else (n2 if third else n0)
        length = np.sqrt(n)
        x, y, z = x / length, y / length, z / length
        away = x * px[k] + y * py[k] + z * pz[k] > 0.0
        has_normal = (scale[k] > 0.0) & (n > 0.0)
        normals[k, 0] = np.float32((-x if away else x) if has_normal else 0.0)
        normals[k, 1] = np.float32((-y if away else y) if has_normal else 0.0)
        normals[k, 2] = np.float32((-z if away else z) if has_normal else 0.0)


@compiled
def _row_of_normals(
    xs: np.ndarray,
    ys: np.ndarray,
    zs: np.ndarray,
    v: int,
    window: int,
    step: int,
    distance_factor: float,
    normals: np.ndarray,
) -> None:
    """Write the normals (W, 3) of row v of points whose coordinates are images (H, W) of their own."""
    height, width = zs.shape
    half = (window // 2) // step * step
    reach = (distance_factor * zs[v].astype(np.float64)) ** 2
    count, steps, sums = np.zeros(width), np.empty((3, width)), np.zeros((9, width))
    for dv in range(-half, half + 1, step):
        row = v + dv
        if row < 0 or row >= height:
            continue
        for du in range(-half, half + 1, step):
            a, b = max(0, -du), min(width, width - du)
            x, y, z = steps[0, a:b], steps[1, a:b], steps[2, a:b]
            neighbours = (xs[row, a + du : b + du], ys[row, a + du : b + du], zs[row, a + du : b + du])
            _steps_to(neighbours, (xs[v, a:b], ys[v, a:b], zs[v, a:b]), reach[a:b], count[a:b], x, y, z)
            _add(x, y, z, sums[0, a:b], sums[1, a:b], sums[2, a:b])
            _add_products(x, y, z, sums[3, a:b], sums[4, a:b], sums[5, a:b])
            _add_other_products(y, z, sums[6, a:b], sums[7, a:b], sums[8, a:b])
    scale, determinant = np.empty(width), np.empty(width)
    _covariances(count, sums, scale, determinant)
    for u in range(width):
        if zs[v, u] <= 0.0 or count[u] < 4:
            scale[u] = 0.0
    _smallest_eigenvalues(scale, determinant, sums)
    _directions(xs[v], ys[v], zs[v], scale, sums, normals)


@compiled(parallel=True)
def _window_normals(
    xs: np.ndarray, ys: np.ndarray, zs: np.ndarray, window: int, step: int, distance_factor: float
) -> np.ndarray:
    """Normals (H, W, 3) of points whose coordinates are images (H, W) of their own."""
    normals = np.zeros((zs.shape[0], zs.shape[1], 3), dtype=np.float32)
    for v in prange(zs.shape[0]):
        _row_of_normals(xs, ys, zs, v, window, step, distance_factor, normals[v])
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
    return _window_normals(*planes_of(points), window, step, distance_factor)


def planes_of(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the coordinates of vectors (H, W, 3) as images (H, W) float32 of their own."""
    x, y, z = np.ascontiguousarray(vectors.transpose(2, 0, 1), dtype=np.float32)
    return x, y, z

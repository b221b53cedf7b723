"""Real spherical harmonics up to degree 3, with the signs and the order that splat files use."""

from __future__ import annotations

import numpy as np

LEVEL_0 = 0.28209479177387814
"""1 / sqrt(4 pi): colour - 0.5 of a Gaussian that looks alike from everywhere is this times its first coefficient."""
_1 = 0.4886025119029199
_2 = (1.0925484305920792, 0.31539156525252005, 0.5462742152960396)
_3 = (0.5900435899266435, 2.890611442640554, 0.4570457994644658, 0.3731763325901154, 1.445305721320277)


def basis(directions: np.ndarray, count: int) -> np.ndarray:
    """Return the first `count` (1, 4, 9 or 16) harmonics (N, count) at unit directions (N, 3).

    Sloan, "Efficient spherical harmonic evaluation" (2013), with the Condon-Shortley phase, as Kerbl et al. (2023).
    """
    x, y, z = np.asarray(directions).T
    values = np.empty((len(x), count), dtype=np.asarray(directions).dtype)
    values[:, 0] = LEVEL_0
    if count > 1:
        values[:, 1], values[:, 2], values[:, 3] = -_1 * y, _1 * z, -_1 * x
    if count > 4:
        xx, yy, zz = x * x, y * y, z * z
        values[:, 4], values[:, 5] = _2[0] * x * y, -_2[0] * y * z
        values[:, 6] = _2[1] * (2.0 * zz - xx - yy)
        values[:, 7], values[:, 8] = -_2[0] * x * z, _2[2] * (xx - yy)
    if count > 9:
        values[:, 9] = -_3[0] * y * (3.0 * xx - yy)
        values[:, 10] = _3[1] * x * y * z
        values[:, 11] = -_3[2] * y * (4.0 * zz - xx - yy)
        values[:, 12] = _3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy)
        values[:, 13] = -_3[2] * x * (4.0 * zz - xx - yy)
        values[:, 14] = _3[4] * z * (xx - yy)
        values[:, 15] = -_3[0] * x * (xx - 3.0 * yy)
    return values


def view_basis(means: np.ndarray, camera_from_world: np.ndarray, count: int) -> np.ndarray:
    """Return the harmonics (N, count) at the directions from the camera to the means (N, 3)."""
    rotation, translation = camera_from_world[:3, :3], camera_from_world[:3, 3]
    directions = means - (-rotation.T @ translation).astype(means.dtype)
    lengths = np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), np.finfo(means.dtype).tiny)
    return basis(directions / lengths, count)

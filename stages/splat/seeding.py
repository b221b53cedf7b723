"""Gaussians out of pixels with depth."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from stages.kit.geometry.cameras import back_project
from stages.kit.geometry.transforms import apply, inverse
from stages.kit.rendering.splatting.gaussians import Gaussians
from stages.kit.rendering.splatting.harmonics import LEVEL_0
from stages.splat.views import PosedView


def at_pixels(
    view: PosedView,
    pixels: np.ndarray,
    depth: np.ndarray,
    deviations: np.ndarray,
    opacity: float,
    camera_from_world: np.ndarray,
) -> Gaussians:
    """Return round Gaussians where pixels (K, 2), row and column, stand at depth (H, W) [m], in the pixels' colours.

    `deviations` (K,): standard deviation of each [m].
    """
    rows, columns = pixels.T
    points = back_project(depth, view.camera)[rows, columns].astype(float)
    count = len(points)
    harmonics = np.zeros((count, 1, 3), np.float32)
    harmonics[:, 0] = (view.color[rows, columns] - 0.5) / LEVEL_0
    quaternions = np.zeros((count, 4), np.float32)
    quaternions[:, 0] = 1.0
    return Gaussians(
        apply(inverse(camera_from_world), points).astype(np.float32),
        quaternions,
        np.repeat(np.log(deviations)[:, None], 3, axis=1).astype(np.float32),
        np.full(count, np.log(opacity / (1 - opacity)), np.float32),
        harmonics,
        np.zeros((count, 0), np.float32),
    )


def filled(depth: np.ndarray) -> np.ndarray:
    """Return depth (H, W) [m] with the nearest known value where it is unknown (0); all unknown stays so."""
    unknown = depth <= 0
    if unknown.all() or not unknown.any():
        return depth
    rows, columns = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return depth[rows, columns]

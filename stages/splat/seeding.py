"""Gaussians out of pixels with depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.geometry.cameras import back_project, project
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.harmonics import LEVEL_0
from scenewright.stages.splat.views import PosedView
from scipy.ndimage import distance_transform_edt

DEPTH_ERROR = 0.08
"""Difference, over the depth, from which on what is shown and what was measured are two things; by eye."""

DENSE = 0.1
"""Share of a picture with depth from which on it sees through what lies before: a depth camera's. Triangulated points
are corners, few of them, and each says little of its surroundings."""


class Seeds(NamedTuple):
    """Gaussians to add."""

    gaussians: Gaussians
    guessed: np.ndarray
    """(N,) bool: set where no depth was measured, so that a later view may see through them."""


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


def seen_through(points: np.ndarray, view: PosedView, camera_from_world: np.ndarray) -> np.ndarray:
    """Return which points (N, 3) [m], in the world, lie before the depth that a view measured there, as (N,) bool.

    None of them do where the view is not DENSE.
    """
    if view.depth is None or (view.depth > 0).mean() < DENSE:
        return np.zeros(len(points), bool)
    pixels, depth = project(apply(camera_from_world, points.astype(float)), view.camera)
    height, width = view.depth.shape
    columns, rows = np.nan_to_num(np.round(pixels), nan=-1).clip(-1, max(width, height)).astype(int).T
    inside = (depth > 0) & (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
    measured = np.zeros(len(points))
    measured[inside] = view.depth[rows[inside], columns[inside]]
    return measured > depth * (1 + DEPTH_ERROR)

"""The box of what was seen of an entity, from points that are noisy, incomplete and now and then somebody else's."""

from __future__ import annotations

import numpy as np

from schemas.scene_parts import Box
from stages.kit.geometry.boxes import gravity_aligned_box, minimum_rectangle
from stages.kit.geometry.point_clouds import without_strays

QUARTER = np.pi / 2
UPRIGHT_SLOPE = 0.35
"""A surface whose normal rises by less than this belongs to a side."""
LEAST_SIDE_POINTS = 30
BIN = np.radians(2.0)
"""Width of the bins in which side directions are counted [rad]."""


def side_yaw(normals: np.ndarray, *, minimum_share: float) -> float | None:
    """Return the yaw in [-pi/4, pi/4) on which the sides of a body agree modulo a quarter turn, None when they do not.

    `normals` (N, 3) unit. The sides of furniture and boxes are parallel or square to each other, so that the azimuths
    of their normals fall together modulo 90 degrees, also when only one or two sides were seen and the footprint that
    is left says nothing. A round thing spreads them evenly: then fewer than `minimum_share` lie within 6 degrees of
    the mode.
    """
    sides = normals[np.abs(normals[:, 2]) < UPRIGHT_SLOPE]
    if len(sides) < LEAST_SIDE_POINTS:
        return None
    azimuths = np.arctan2(sides[:, 1], sides[:, 0]) % QUARTER
    count = round(QUARTER / BIN)
    histogram = np.bincount(np.minimum((azimuths / BIN).astype(int), count - 1), minlength=count).astype(float)
    window = histogram + np.roll(histogram, 1) + np.roll(histogram, -1)
    mode = (int(np.argmax(window)) + 0.5) * BIN
    offsets = (azimuths - mode + QUARTER / 2) % QUARTER - QUARTER / 2
    near = np.abs(offsets) < 3 * BIN
    if near.mean() < minimum_share:
        return None
    yaw = mode + float(np.median(offsets[near]))
    return float((yaw + QUARTER / 2) % QUARTER - QUARTER / 2)


def trimmed_extent(values: np.ndarray, trim: float) -> tuple[float, float]:
    """Return the smallest and largest of values (N,) without the share `trim` at either end."""
    low, high = np.quantile(values, [trim, 1.0 - trim])
    return float(low), float(high)


def observed_box(
    points: np.ndarray,
    normals: np.ndarray,
    *,
    stray_share: float,
    stray_distance: float,
    trim: float,
    side_share: float | None,
) -> tuple[Box, np.ndarray]:
    """Return the gravity-aligned box of points (N, 3) [m] with unit normals (N, 3), and which points it was put around.

    Labels leak at object borders, onto what stands behind them and beside them. Small clusters that are cut off from
    the rest are left out (point_clouds.without_strays), and so is the share `trim` at both ends of every axis: a side
    that was seen holds far more points than that. The yaw is that of the sides (`side_yaw`; None: not asked for),
    else of the least rectangle, as the thesis has it (section 2.2.2).
    """
    kept = without_strays(points, stray_share, stray_distance)
    inside = points[kept]
    yaw = None if side_share is None else side_yaw(normals[kept], minimum_share=side_share)
    if yaw is None:
        _, _, yaw = minimum_rectangle(inside[:, :2])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    left, right = trimmed_extent(inside[:, :2] @ np.array([cosine, sine]), trim)
    front, back = trimmed_extent(inside[:, :2] @ np.array([-sine, cosine]), trim)
    bottom, top = trimmed_extent(inside[:, 2], trim / 2)
    middle = np.array([(left + right) / 2, (front + back) / 2])
    center = np.array([[cosine, -sine], [sine, cosine]]) @ middle
    box = gravity_aligned_box((*center, (bottom + top) / 2), (right - left, back - front, top - bottom), yaw)
    return box, kept

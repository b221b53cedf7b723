"""The footprint of a thing of revolution: where the normals of its sides meet, and how far from there the sides lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAST_POINTS = 20
"""With fewer usable normals no axis is sought; by eye."""
LEVEL_SHARE = 0.3
"""Least level part of a normal that says where the axis is."""
LEAST_TURN = 0.08
"""The sides must have been seen around a corner: smaller eigenvalue of the spread of their directions, of their sum."""
LARGEST_MISS = 0.2
"""Median distance between the axis and the lines along the normals, of the radius. Bottles and bowls of 2 cm voxels
miss by 0.1 to 0.16, faces of a box by 0.2 and more."""
LEAST_SIDES = 0.3
"""Share of the points that must lie on sides: those of a book are no evidence for its outline."""
RADIUS_QUANTILE = 0.9
"""Quantile of the distances from the axis that is the radius; what stands out farther is handle or noise. By eye."""
HANDLE_REACH = 1.25
"""Distance from the axis, in radii, from which on points are no noise of the wall."""
HANDLE_SHARE = 0.03
"""Share of the points from which on what lies farther out is a handle or a spout."""
HANDLE_AGREEMENT = 0.8
"""Length of the mean direction of those points: a handle stands to one side."""


@dataclass(frozen=True)
class RoundFootprint:
    """A disc in the ground plane [m], and the direction of a handle."""

    center: np.ndarray
    """(2,)"""
    radius: float
    handle_yaw: float | None
    """Where something stands out to one side [rad], else None."""


def round_footprint(points: np.ndarray, normals: np.ndarray) -> RoundFootprint | None:
    """Return the disc that a thing of revolution stands over, None where points (N, 3) [m] with unit normals (N, 3)
    are none of such a thing.

    Every line along a normal of a surface of revolution meets the axis. Two least-squares rounds, the second without
    the worst quarter, find the point of the ground plane that is nearest to all of them; so that half of a bottle tells
    its whole diameter.
    """
    level = np.linalg.norm(normals[:, :2], axis=1)
    usable = level > LEVEL_SHARE
    if np.count_nonzero(usable) < max(LEAST_POINTS, LEAST_SIDES * len(points)):
        return None
    ground = points[usable, :2]
    across = np.stack([-normals[usable, 1], normals[usable, 0]], axis=1) / level[usable, None]
    inliers = np.ones(len(ground), dtype=bool)
    for _ in range(2):
        spread = across[inliers].T @ across[inliers]
        if np.linalg.eigvalsh(spread)[0] < LEAST_TURN * np.trace(spread):
            return None
        offsets = np.einsum("ij,ij->i", across, ground)
        center = np.linalg.solve(spread, across[inliers].T @ offsets[inliers])
        misses = np.abs(offsets - across @ center)
        inliers = misses <= np.quantile(misses, 0.75)
    distances = np.linalg.norm(points[:, :2] - center, axis=1)
    radius = float(np.quantile(distances[usable], RADIUS_QUANTILE))
    if float(np.median(misses)) > LARGEST_MISS * radius:
        return None
    outside = distances > HANDLE_REACH * radius
    handle_yaw = None
    if outside.mean() >= HANDLE_SHARE:
        direction = ((points[outside, :2] - center) / distances[outside, None]).mean(axis=0)
        if np.linalg.norm(direction) < HANDLE_AGREEMENT:
            return None
        handle_yaw = float(np.arctan2(direction[1], direction[0]))
    return RoundFootprint(center, radius, handle_yaw)

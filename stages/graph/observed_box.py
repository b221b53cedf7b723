"""The box of what was seen of an entity, from points that are noisy, incomplete and now and then somebody else's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.graph.round_footprint import RoundFootprint, round_footprint
from scenewright.stages.kit.geometry.boxes import gravity_aligned_box, minimum_rectangle
from scenewright.stages.kit.geometry.point_clouds import without_strays

Extent = tuple[float, float]
"""Least and largest coordinate [m]."""
QUARTER = np.pi / 2
"""A quarter turn [rad]: by so much the sides of a box repeat."""
UPRIGHT_SLOPE = 0.35
"""A surface whose normal rises by less than this belongs to a side."""
LEAST_SIDE_POINTS = 30
"""With fewer points on upright sides a box has no yaw of its own; by eye."""
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
    near_mode = np.abs(offsets) < 3 * BIN
    if near_mode.mean() < minimum_share:
        return None
    yaw = mode + float(np.median(offsets[near_mode]))
    return float((yaw + QUARTER / 2) % QUARTER - QUARTER / 2)


def trimmed_extent(values: np.ndarray, trim: float) -> tuple[float, float]:
    """Return the smallest and largest of values (N,) without the share `trim` at either end."""
    low, high = np.quantile(values, [trim, 1.0 - trim])
    return float(low), float(high)


@dataclass(frozen=True)
class BoxFit:
    """What is left out of a box, and how its yaw is found."""

    stray_share: float
    stray_distance: float
    """[m]"""
    trim: float = 0.0
    """Share of the points that is left out at both ends of every axis."""
    side_share: float | None = None
    """See `side_yaw`; None: the least rectangle says the yaw."""
    may_be_round: bool = False


def observed_box(points: np.ndarray, normals: np.ndarray, fit: BoxFit) -> tuple[Box, np.ndarray]:
    """Return the gravity-aligned box of points (N, 3) [m] with unit normals (N, 3), and which points it was put around.

    Labels leak at object borders, onto what stands behind them and beside them. Small clusters that are cut off from
    the rest are left out (point_clouds.without_strays), and so is the share `trim` at both ends of every axis: a side
    that was seen holds far more points than that. A thing that `may_be_round` gets the box of its disc where its sides
    say that it is. Else the yaw is that of the sides (`side_yaw`), or of the least rectangle, as the thesis has it
    (section 2.2.2).
    """
    not_stray = without_strays(points, fit.stray_share, fit.stray_distance)
    inside = points[not_stray]
    bottom, top = trimmed_extent(inside[:, 2], fit.trim / 2)
    if fit.may_be_round and (disc := round_footprint(inside, normals[not_stray])) is not None:
        return box_over_disc(disc, inside, (bottom, top), fit.trim), not_stray
    yaw = None if fit.side_share is None else side_yaw(normals[not_stray], minimum_share=fit.side_share)
    if yaw is None:
        _, _, yaw = minimum_rectangle(inside[:, :2])
    along, across = axes_of(yaw)
    sides = trimmed_extent(inside[:, :2] @ along, fit.trim), trimmed_extent(inside[:, :2] @ across, fit.trim)
    return box_between(*sides, (bottom, top), yaw), not_stray


def box_over_disc(disc: RoundFootprint, points: np.ndarray, height: Extent, trim: float) -> Box:
    """Return the box of a round thing: as wide as its disc, turned and widened to where a handle among points (N, 3)
    stands out. `height`: bottom and top [m]."""
    yaw = disc.handle_yaw or 0.0
    along, across = axes_of(yaw)
    low, high = disc.center @ along - disc.radius, disc.center @ along + disc.radius
    if disc.handle_yaw is not None:
        high = max(high, trimmed_extent(points[:, :2] @ along, trim)[1])
    middle = disc.center @ across
    return box_between((low, high), (middle - disc.radius, middle + disc.radius), height, yaw)


def axes_of(yaw: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the ground directions (2,) along and across a yaw [rad]."""
    return np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])


def box_between(along: Extent, across: Extent, height: Extent, yaw: float) -> Box:
    """Return the box with these extents [m] along the axes of a yaw [rad]."""
    first, second = axes_of(yaw)
    center = sum(along) / 2 * first + sum(across) / 2 * second
    size = (along[1] - along[0], across[1] - across[0], height[1] - height[0])
    return gravity_aligned_box((*center, sum(height) / 2), size, yaw)

"""Feet of what floats: of a shade on a thin pole, a screen on its neck, depth shows the upper and the lower part alone.

Ours. Nothing floats. Where a thing has no level surface close below it and no wall beside it, and its middle is over
one nameless thing that is much narrower, it stands on that alone, and both are one.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.pieces import LEVEL, RISE, STACKED_GAP, WITHIN, Footprint, members_of
from scipy.spatial import cKDTree

NARROWER = 0.5
"""A foot has at most this share of the ground of what it carries."""
AROUND = 0.1
"""A level surface so near beside a thing [m] goes on below it, where it cannot be seen; a wall so near may carry it."""
CARRIES = 0.1
"""A level surface carries a thing from this share of its ground on."""


def feet_of(
    scene: Scene, instance: np.ndarray, things: Collection[int], nameless: Collection[int], wall: int, voxel: float
) -> dict[int, int]:
    """Return {foot: the thing that stands on it alone} of instances (V,), 0 none.

    `things`: those that may have a foot; `nameless`: those that may be one; `wall`: that of walls; `voxel` [m]. A foot
    may have a foot itself; each lies lower than what stands on it.
    """
    points = {name: scene.vertices[own] for name, own in members_of(instance, 1).items()}
    ends = {name: np.quantile(each, (0.02, 0.98), axis=0) for name, each in points.items()}
    feet = sorted(set(nameless) & set(points))
    below = np.array([ends[foot] for foot in feet]).reshape(-1, 2, 3)
    gaps: dict[int, tuple[float, int]] = {}
    for thing in sorted(set(things) & set(points)):
        low, area = float(ends[thing][0, 2]), float(np.prod(np.ptp(ends[thing], axis=0)[:2]))
        off, widths = ends[thing].mean(axis=0) - below.mean(axis=1), np.ptp(below, axis=1)[:, :2]
        gap = low - below[:, 1, 2]
        over = (
            (off[:, 2] > 0) & (np.abs(off[:, :2]) <= 0.5 * widths).all(axis=1) & (gap >= -RISE) & (gap <= STACKED_GAP)
        )
        for k in np.flatnonzero(over & (np.prod(widths, axis=1) <= NARROWER * area)):
            foot, ground = feet[k], Footprint(points[thing][:, :2], voxel)
            others = (instance != thing) & (instance != foot)
            if (
                gap[k] < gaps.get(foot, (np.inf, 0))[0]
                and ground.holds(points[foot]).mean() >= WITHIN
                and level_area(scene, others, ground, low, voxel) < CARRIES * area
                and not _is_near(points[thing], points.get(wall))
            ):
                gaps[foot] = float(gap[k]), thing
    return {foot: thing for foot, (_, thing) in gaps.items()}


def level_area(scene: Scene, among: np.ndarray, ground: Footprint, height: float, voxel: float) -> float:
    """Return how much of the vertices `among` (V,) bool looks up about a height [m], over or beside a ground [m²]."""
    close = among & (scene.normals[:, 2] > LEVEL) & (np.abs(scene.vertices[:, 2] - height) <= 2 * RISE)
    return float((ground.depth(scene.vertices[close]) > -AROUND).sum() * voxel**2)


def _is_near(points: np.ndarray, wall: np.ndarray | None) -> bool:
    """Whether any of points (N, 3) is near one of a wall (M, 3) [m]."""
    if wall is None:
        return False
    return bool(np.isfinite(cKDTree(wall).query(points, distance_upper_bound=AROUND)[0]).any())

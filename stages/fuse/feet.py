"""Feet of what floats: of a shade on a thin pole, a screen on its neck, depth shows the upper and the lower part alone.

Ours. Nothing floats. Where a thing has no level surface close below it, and its middle is over one nameless thing that
is much narrower, it stands on that alone, and both are one.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.pieces import LEVEL, RISE, STACKED_GAP, WITHIN, Footprint, members_of

NARROWER = 0.5
"""A foot has at most this share of the ground of what it carries."""
AROUND = 0.1
"""A level surface so near beside a thing [m] goes on below it, where it cannot be seen."""
CARRIES = 0.1
"""A level surface carries a thing from this share of its ground on."""


def feet_of(
    scene: Scene, instance: np.ndarray, things: Collection[int], nameless: Collection[int], voxel: float
) -> dict[int, int]:
    """Return {foot: the thing that stands on it alone} of instances (V,), 0 none.

    `things`: those that may have a foot; `nameless`: those that may be one; `voxel` [m]. A foot may have a foot itself;
    each lies lower than what stands on it.
    """
    points = {name: scene.vertices[own] for name, own in members_of(instance, 1).items()}
    ends = {name: np.quantile(each, (0.02, 0.98), axis=0) for name, each in points.items()}
    gaps: dict[int, tuple[float, int]] = {}
    for thing in sorted(set(things) & set(points)):
        middle, low = ends[thing].mean(axis=0)[:2], float(ends[thing][0, 2])
        for foot in sorted(set(nameless) & set(points) - {thing}):
            gap = low - float(ends[foot][1, 2])
            over = np.all(np.abs(middle - ends[foot].mean(axis=0)[:2]) <= 0.5 * np.ptp(ends[foot], axis=0)[:2])
            higher = ends[thing][:, 2].sum() > ends[foot][:, 2].sum()
            if not (-RISE <= gap <= STACKED_GAP and over and higher) or gap >= gaps.get(foot, (np.inf, 0))[0]:
                continue
            area, own = (float(np.prod(np.ptp(ends[name], axis=0)[:2])) for name in (thing, foot))
            ground = Footprint(points[thing][:, :2], voxel)
            if own > NARROWER * area or ground.holds(points[foot]).mean() < WITHIN:
                continue
            close = np.abs(scene.vertices[:, 2] - low) <= 2 * RISE
            close &= (scene.normals[:, 2] > LEVEL) & (instance != thing) & (instance != foot)
            around = scene.vertices[close]
            if (ground.depth(around) > -AROUND).sum() * voxel**2 < CARRIES * area:
                gaps[foot] = gap, thing
    return {foot: thing for foot, (_, thing) in gaps.items()}

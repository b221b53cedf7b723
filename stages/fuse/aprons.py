"""Aprons: what masks of a thing have of the level top on which it stands.

Ours. The mask of a cup runs over onto the table beside it. Such surface is level, goes on flush in a larger top of
another thing, and the rest of its own thing rises over it. Where masks are less sure of it than of that rest, it is of
the top; the plate under a lamp they have as often as the lamp.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scenewright.stages.fuse.belief import AS_SURE, FLUSH_STEP
from scenewright.stages.fuse.connecting import connected
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.pieces import LEVEL, RISE, members_of
from scipy.spatial import cKDTree

RISING = 0.5
"""Share of a thing that rises over its apron, and more than the apron is: a magazine on a table has none."""
BELOW = 0.05
"""Share of a thing that may lie below its apron: the seat of a chair is none."""


def without_aprons(
    scene: Scene, instance: np.ndarray, told: np.ndarray, things: Collection[int], voxel: float
) -> np.ndarray:
    """Return the instances (V,), 0 none, where aprons are of the thing in whose top they go on.

    `told` (V,): mean score a look of the masks of their own thing; `things`: those that have aprons and tops; `voxel`
    [m].
    """
    result = instance.copy()
    level = np.flatnonzero((scene.normals[:, 2] > LEVEL) & np.isin(instance, sorted(things)))
    if not len(level):
        return result
    points, thing_of = scene.vertices[level], instance[level]
    patch_of = connected(points, 2 * voxel, thing_of)
    size, tree = np.bincount(patch_of), cKDTree(points)
    members = members_of(instance, 1)
    for patch, own in members_of(patch_of, 0).items():
        thing, height = int(thing_of[own[0]]), float(np.median(points[own, 2]))
        over = scene.vertices[members[thing], 2] - height
        if len(own) >= RISING * len(over) or (over > RISE).mean() < RISING or (over < -RISE).mean() > BELOW:
            continue
        if told[level[own]].mean() >= AS_SURE * told[members[thing]].mean():
            continue
        near = np.unique(np.concatenate(tree.query_ball_point(points[own], 2 * voxel)).astype(int))
        is_flush = np.abs(points[near, 2] - height) <= FLUSH_STEP * voxel
        beside = near[is_flush & (thing_of[near] != thing) & (size[patch_of[near]] > size[patch])]
        if len(beside):
            result[level[own]] = np.bincount(thing_of[beside]).argmax()
    return result

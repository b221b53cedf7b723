"""Parts that masks take for one thing: a shelf's compartments, the two halves of a fridge.

Ours. Geometry cuts at level tops and where masks end. Two parts that touch are one thing where masks had both, in at
least two looks, and hardly ever one of them alone. What stands on a level top of the other stays apart: masks take it
along.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.looks import FEWEST
from scipy.spatial import cKDTree

HAS = 0.5
"""A mask has a thing when it has this share of what a look sees of it."""
LACKS = 0.2
"""It has not where it has less."""
FEWEST_LOOKS = 2
"""One look with both may be a mask that ran over."""
RARELY = 0.1
"""Looks that part two things are rare up to this share of those that join them."""
TOUCHING = 3.0
"""Parts this close to each other touch [voxels]."""
FACES_UP = 0.9
"""Cosine of a normal to the vertical from which on surface is a top."""
UNDER = 4.0
"""A foot stands on the top that is so close under it [voxels]."""


def pair_looks(looks: Iterable[tuple[np.ndarray, np.ndarray]]) -> tuple[Counter[tuple[int, int]], ...]:
    """Return for pairs of things in how many looks one mask has both, and in how many one has a single one of them.

    looks: per look the mask (N,) of every point, 0 none, and the thing (N,), 0 none.
    """
    both, apart = Counter[tuple[int, int]](), Counter[tuple[int, int]]()
    for mask, thing in looks:
        things, place, seen = np.unique(thing, return_inverse=True, return_counts=True)
        points = np.zeros((len(things), int(mask.max(initial=0)) + 1))
        np.add.at(points, (place.ravel(), mask), 1)
        share = points[:, 1:] / points.sum(axis=1, keepdims=True)
        has, lacks = share >= HAS, share < LACKS
        shown = (things > 0) & (seen >= FEWEST)
        for a in np.flatnonzero(shown).tolist():
            for b in np.flatnonzero(shown[a + 1 :]) + a + 1:
                pair = int(things[a]), int(things[b])
                if (has[a] & has[b]).any():
                    both[pair] += 1
                elif (has[a] & lacks[b]).any() or (has[b] & lacks[a]).any():
                    apart[pair] += 1
    return both, apart


def stands_on(upper: np.ndarray, lower: np.ndarray, normals: np.ndarray, voxel: float) -> bool:
    """Whether most of the foot of points (N, 3) lies over tops of points (M, 3) with normals (M, 3) [m]."""
    tops = lower[normals[:, 2] > FACES_UP]
    if not len(tops):
        return False
    foot = upper[upper[:, 2] <= np.quantile(upper[:, 2], 0.1)] - [0.0, 0.0, voxel]
    return bool(np.isfinite(cKDTree(tops).query(foot, distance_upper_bound=UNDER * voxel)[0]).mean() > 0.5)


def joined(
    scene: Scene,
    instance: np.ndarray,
    things: frozenset[int],
    looks: Iterable[tuple[np.ndarray, np.ndarray]],
    voxel: float,
) -> dict[int, int]:
    """Return {part: the thing that it is of}, the part with most surface, for things (V,) whose parts are one.

    `things`: instances that may be joined; `looks` as in `pair_looks`; `voxel` [m].
    """
    both, apart = pair_looks(looks)
    size, points = np.bincount(instance), {}
    home: dict[int, int] = {}
    order = sorted(both, key=lambda pair: (-both[pair], pair))
    for pair in order:
        if both[pair] < FEWEST_LOOKS or apart[pair] > RARELY * both[pair] or not things.issuperset(pair):
            continue
        for k in pair:
            if k not in points:
                own = instance == k
                points[k] = scene.vertices[own], scene.normals[own]
        (first, up_first), (second, up_second) = (points[k] for k in pair)
        reach = TOUCHING * voxel
        if not np.isfinite(cKDTree(first).query(second, distance_upper_bound=reach)[0]).any():
            continue
        if stands_on(first, second, up_second, voxel) or stands_on(second, first, up_first, voxel):
            continue
        kept, gone = sorted((root(home, k) for k in pair), key=lambda k: (-size[k], k))
        if kept != gone:
            home[gone] = kept
    return {k: root(home, k) for k in home}


def wholes(instance: np.ndarray, parts: Mapping[int, int]) -> np.ndarray:
    """Return (N + 1,) int32 per instance, up to the largest N of instances (V,), the thing that it is of."""
    return np.array([parts.get(k, k) for k in range(int(instance.max(initial=0)) + 1)], np.int32)


def root(home: Mapping[int, int], k: int) -> int:
    """Return the thing of which a part of a part is one; `home`: part -> thing, without circles."""
    while k in home:
        k = home[k]
    return k

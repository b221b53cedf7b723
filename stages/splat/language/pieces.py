"""Pieces of a splat without a word: Gaussians that are neighbours, of like colour and on one surface.

Efficient graph-based segmentation (Felzenszwalb & Huttenlocher 2004) on the graph of nearest Gaussians; an edge weighs
how far colours and normals are apart. Coarser pieces are made of finer ones.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.geometry.point_clouds import normals_of_neighbours
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scipy.spatial import cKDTree

SEEN = 0.15
"""Opacity from which on a Gaussian belongs to a surface."""
NEIGHBOURS = 10
"""Nearest Gaussians that one may be joined with; by eye."""
SMOOTH = 16
"""Neighbours whose plane is a Gaussian's normal."""
REACH = 3.0
"""Neighbours farther apart than this many usual distances are none."""
GRANULARITIES = (0.15, 0.6, 2.0)
"""How readily pieces join: the constant k of the method."""
SMALLEST = 6
"""Gaussians that a piece needs; by eye."""
COLOR, BEND = 1.0, 0.7
"""Weights of a difference of colour (sRGB, length) and of 1 - |cosine| of normals."""
FIRST_HARMONIC = 0.28209479177387814
"""Value of the first spherical harmonic, 1 / (2 sqrt(pi))."""


def pieces(gaussians: Gaussians) -> np.ndarray:
    """Return (granularities, N) int32: number of the piece of every Gaussian, from 0; -1: it is hardly there."""
    result = np.full((len(GRANULARITIES), len(gaussians)), -1, np.int32)
    opacities = 1.0 / (1.0 + np.exp(-gaussians.logit_opacities))
    solid = np.flatnonzero(opacities > SEEN)
    if len(solid) < 2:
        result[:, solid] = 0
        return result
    means = gaussians.means[solid].astype(float)
    colors = np.clip(gaussians.harmonics[solid, 0] * FIRST_HARMONIC + 0.5, 0, 1)
    tree = cKDTree(means)
    count = min(SMOOTH, len(solid) - 1)
    distances, neighbours = tree.query(means, count + 1)
    normals = normals_of_neighbours(means[neighbours])
    colors = np.median(colors[neighbours[:, :6]], axis=1)
    neighbour_count = min(NEIGHBOURS, count)
    first = np.repeat(np.arange(len(solid)), neighbour_count)
    second, apart = (
        neighbours[:, 1 : neighbour_count + 1].reshape(-1),
        distances[:, 1 : neighbour_count + 1].reshape(-1),
    )
    usual = np.maximum(np.median(distances[:, 1 : neighbour_count + 1], axis=1), 1e-4)
    is_close = apart < REACH * np.minimum(usual[first], usual[second])
    first, second = first[is_close], second[is_close]
    bend = 1.0 - np.abs(np.einsum("ni,ni->n", normals[first], normals[second]))
    weights = COLOR * np.linalg.norm(colors[first] - colors[second], axis=1) + BEND * bend
    order = np.argsort(weights, kind="stable")
    first, second, weights = first[order], second[order], weights[order]
    for row, granularity in enumerate(GRANULARITIES):
        roots = _join_pieces(first, second, weights, len(solid), granularity, SMALLEST)
        result[row, solid] = np.unique(roots, return_inverse=True)[1]
    return result


@compiled
def _root(parents: np.ndarray, k: int) -> int:
    while parents[k] != k:
        parents[k] = parents[parents[k]]
        k = parents[k]
    return k


@compiled
def _join_pieces(
    first: np.ndarray, second: np.ndarray, weights: np.ndarray, count: int, granularity: float, smallest: int
) -> np.ndarray:
    """Return the root of every one of `count` nodes; edges ascend in weight."""
    parents, sizes, inner = np.arange(count), np.ones(count, np.int64), np.zeros(count)
    for e in range(len(first)):
        a, b = _root(parents, first[e]), _root(parents, second[e])
        if a != b and weights[e] <= min(inner[a] + granularity / sizes[a], inner[b] + granularity / sizes[b]):
            parents[b] = a
            sizes[a] += sizes[b]
            inner[a] = weights[e]
    for e in range(len(first)):
        a, b = _root(parents, first[e]), _root(parents, second[e])
        if a != b and (sizes[a] < smallest or sizes[b] < smallest):
            parents[b] = a
            sizes[a] += sizes[b]
    roots = np.empty(count, np.int64)
    for k in range(count):
        roots[k] = _root(parents, k)
    return roots

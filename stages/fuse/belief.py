"""Which things of masks are believed in their shape: those that have an outline in space, or masks that are sure.

Ours. Where a mask ends at a step, a crease or in the air, a few looks that had it are enough. Where the surface goes on
flush beyond it, the mask alone has cut it, and has to be as sure as the same masks are of things that stand free: a
mask of a chair that runs over the counter behind it is not, one of a book on a table is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

NEAR, FAR = 1.75, 3.0
"""Surface within this many voxels of a vertex is asked whether it goes on flush."""
FLUSH_COSINE, FLUSH_STEP = 0.9, 0.6
"""Flush is what bends by less, and is off by fewer voxels."""
RING = 3.0
"""Vertices across the rim of a thing that have flush neighbours."""
OUTLINE = 0.5
"""A thing along this share of whose outline surface goes on flush has no outline in space."""
AS_SURE = 0.85
"""Share of what masks say of things that stand free, under which they are not as sure."""
WEAK = 0.3
"""Under this share masks say next to nothing."""


def flush_shares(vertices: np.ndarray, normals: np.ndarray, instance: np.ndarray, voxel: float) -> np.ndarray:
    """Return by instance (I + 1,) along which share of its outline the surface goes on flush, 0..1.

    vertices, normals (V, 3), instance (V,); `voxel` [m], a vertex stands for one.
    """
    tree = cKDTree(vertices)
    pairs = tree.query_pairs(FAR * voxel, output_type="ndarray")
    pairs = pairs[instance[pairs[:, 0]] != instance[pairs[:, 1]]]
    offset = vertices[pairs[:, 1]] - vertices[pairs[:, 0]]
    distance = np.linalg.norm(offset, axis=1)
    first, second = normals[pairs[:, 0]], normals[pairs[:, 1]]
    flush = (distance > NEAR * voxel) & (np.einsum("ij,ij->i", first, second) > FLUSH_COSINE)
    for normal in (first, second):
        flush &= np.abs(np.einsum("ij,ij->i", offset, normal)) < FLUSH_STEP * voxel
    on_rim = np.zeros(len(vertices), bool)
    on_rim[pairs[flush].ravel()] = True
    size = np.bincount(instance)
    outline = RING * 2 * np.sqrt(np.pi * np.maximum(size, 1))
    return np.asarray(np.minimum(np.bincount(instance[on_rim], minlength=len(size)) / outline, 1.0))


def usual_score(things: Sequence[int], told: Mapping[int, float], flush: np.ndarray) -> float:
    """Return what masks usually say of things that stand free; arguments as in `doubted`."""
    free = [told[k] for k in things if flush[k] < OUTLINE]
    return float(np.median(free)) if free else 0.5


def doubted(things: Sequence[int], told: Mapping[int, float], flush: np.ndarray) -> dict[int, str]:
    """Return the things whose shape is not believed, each with the reason.

    `told` [by thing]: mean score, 0..1 a look, of masks of things; `flush`: as in `flush_shares`.
    """
    usual = usual_score(things, told, flush)
    reasons: dict[int, str] = {}
    for k in things:
        if told[k] < WEAK * usual:
            reasons[k] = f"masks had it in few looks: {told[k]:.2f} where {usual:.2f} is usual"
        elif flush[k] >= OUTLINE and told[k] < AS_SURE * usual:
            reasons[k] = f"flush along {flush[k]:.0%} of its outline, and masks are less sure than usual: {told[k]:.2f}"
    return reasons

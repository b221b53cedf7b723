"""Which things of masks are believed in their shape: those that have an outline in space, or masks that are sure.

Ours. Where a mask ends at a step, a crease or in the air, a few looks that had it are enough. Where the surface goes on
flush beyond it, the mask alone has cut it, and has to be as sure as the same masks are of things that stand free: a
mask of a chair that runs over the counter behind it is not, one of a book on a table is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.fuse.connecting import Cells, cells_of, neighbours_of
from scenewright.stages.kit.compiled import compiled

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
    on_rim = np.zeros(len(vertices), bool)
    if len(vertices):
        points, facing = np.ascontiguousarray(vertices, dtype=float), np.ascontiguousarray(normals, dtype=float)
        _mark_rims(points, facing, np.ascontiguousarray(instance), cells_of(points, FAR * voxel), voxel, on_rim)
    size = np.bincount(instance)
    outline = RING * 2 * np.sqrt(np.pi * np.maximum(size, 1))
    return np.asarray(np.minimum(np.bincount(instance[on_rim], minlength=len(size)) / outline, 1.0))


@compiled
def _mark_rims(
    points: np.ndarray, normals: np.ndarray, instance: np.ndarray, cells: Cells, voxel: float, on_rim: np.ndarray
) -> None:
    """Mark the points (N,) beside which the surface goes on flush in another instance."""
    order, starts = cells.order, cells.starts
    for cell in range(len(cells.coordinates)):
        for other in neighbours_of(cells, cell):
            for a in range(starts[cell], starts[cell + 1]):
                for b in range(a + 1 if other == cell else starts[other], starts[other + 1]):
                    i, j = order[a], order[b]
                    if instance[i] == instance[j] or (on_rim[i] and on_rim[j]):
                        continue
                    if _is_flush(points[i], normals[i], points[j], normals[j], voxel):
                        on_rim[i] = on_rim[j] = True


@compiled
def _is_flush(point: np.ndarray, normal: np.ndarray, other: np.ndarray, other_normal: np.ndarray, voxel: float) -> bool:
    """Whether surface goes on flush between two points (3,), close by but not side by side."""
    square, cosine, step, other_step = 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        offset = other[axis] - point[axis]
        square += offset * offset
        cosine += normal[axis] * other_normal[axis]
        step += offset * normal[axis]
        other_step += offset * other_normal[axis]
    near, far, flat = NEAR * voxel, FAR * voxel, FLUSH_STEP * voxel
    is_near = square <= far * far and np.sqrt(square) > near
    return is_near and cosine > FLUSH_COSINE and abs(step) < flat and abs(other_step) < flat


def usual_score(things: Sequence[int], told: np.ndarray, flush: np.ndarray) -> float:
    """Return what masks usually say of things that stand free; arguments as in `doubted`."""
    free = [told[k] for k in things if flush[k] < OUTLINE]
    return float(np.median(free)) if free else 0.5


def doubted(things: Sequence[int], told: np.ndarray, flush: np.ndarray, usual: float) -> dict[int, str]:
    """Return the things whose shape is not believed, each with the reason.

    `told` (I + 1,) [by thing]: mean score, 0..1 a look, of masks of things; `flush`: as in `flush_shares`; `usual`: as
    in `usual_score`.
    """
    reasons: dict[int, str] = {}
    for k in things:
        if told[k] < WEAK * usual:
            reasons[k] = f"masks had it in few looks: {told[k]:.2f} where {usual:.2f} is usual"
        elif flush[k] >= OUTLINE and told[k] < AS_SURE * usual:
            reasons[k] = f"flush along {flush[k]:.0%} of its outline, and masks are less sure than usual: {told[k]:.2f}"
    return reasons

"""Figures about fragments that were made beside those that were wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting.measure.overlap import best_pairs, overlaps
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.canonical import Canonical, canonical
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import pdist

DISTANCE_VOXELS = 10
"""Voxels along the longest edge, between which distances are taken; by eye."""
QUANTILES = np.linspace(0.02, 0.98, 33)
"""Shares at which distributions of distances are compared; by eye."""


@dataclass(frozen=True)
class Scores:
    """`iou_thesis` leaves unmatched fragments out, `iou` counts them as zero."""

    iou_thesis: float
    iou: float
    count_error: int
    volume_error: float
    """Volume that is in fragments of another size, as a share of the goal's."""
    shape_distance: float
    """Mean over matched fragments of how far distances between points within differ, as a share of them; it does not
    depend on any frame."""

    @property
    def count_exact(self) -> bool:
        """Whether there are as many fragments as wanted."""
        return self.count_error == 0


def score(made: Sequence[Body], wanted: Sequence[Body]) -> Scores:
    """Compare fragments. Raises ValueError where either set is empty."""
    if not made or not wanted:
        raise ValueError("nothing to compare")
    shapes = [[canonical(body) for body in bodies] for bodies in (made, wanted)]
    table = overlaps(*shapes)
    matched = [table[pair] for pair in best_pairs(table)]
    return Scores(
        iou_thesis=float(np.mean(matched)),
        iou=float(np.sum(matched) / max(len(made), len(wanted))),
        count_error=abs(len(made) - len(wanted)),
        volume_error=volume_error([body.volume for body in made], [body.volume for body in wanted]),
        shape_distance=shape_distance(*shapes),
    )


def volume_error(made: Sequence[float], wanted: Sequence[float]) -> float:
    """Return the sum of the differences of sorted volumes, the shorter list filled up with zeros, over the goal's."""
    size = max(len(made), len(wanted))
    first, second = (np.sort(np.pad(values, (0, size - len(values))))[::-1] for values in (made, wanted))
    return float(np.abs(first - second).sum() / second.sum())


def shape_distance(made: Sequence[Canonical], wanted: Sequence[Canonical]) -> float:
    """Return the mean relative difference of the quantiles of distances between points (D2, Osada 2002), over the
    pairs that match best."""
    first, second = (np.stack([distances(shape) for shape in shapes]) for shapes in (made, wanted))
    table = np.abs(first[:, None] - second[None]).mean(axis=2) / second.mean(axis=1)
    return float(table[linear_sum_assignment(table)].mean())


def distances(shape: Canonical) -> np.ndarray:
    """Return quantiles of the distances between points on a lattice within a fragment [m]."""
    voxel = float(shape.size.max()) / DISTANCE_VOXELS
    _, filled = shape.voxels(voxel)
    while filled.sum() < 40:  # a thin slice lies between the middles
        voxel *= 0.7
        _, filled = shape.voxels(voxel)
    return np.asarray(np.quantile(pdist(np.argwhere(filled) * voxel), QUANTILES))

"""What a tree of cuts would make of a piece, foreseen on points within it: no mesh is cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stages.cutting.world.body import Body
from stages.cutting.world.canonical import box_edges, canonical
from stages.cutting.world.voxels import Grid, occupancy

LATTICE = 18
"""Points along every edge of the box around a piece."""
IRRATIONAL = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
"""Steps of a sequence that fills the unit cube evenly: powers of the inverse of x^4 = x + 1's root."""


@dataclass(frozen=True)
class Split:
    """Parts along an axis of the piece (0 the shortest), of these weights."""

    axis: int
    parts: tuple[Tree, ...]
    weights: tuple[float, ...]


Tree = Split | None
"""None: a fragment, left as it is."""


def leaves(tree: Tree) -> int:
    """Return how many fragments a tree makes."""
    return 1 if tree is None else sum(leaves(part) for part in tree.parts)


@dataclass(frozen=True)
class Cloud:
    """A piece as points (N, 3) in its canonical frame [m], each standing for the same volume."""

    body: Body
    frame: np.ndarray
    """world_from_fragment (4, 4)."""
    points: np.ndarray
    share: float
    """Volume of a point [m^3]."""

    @cached_property
    def edges(self) -> np.ndarray:
        """Edges of the box with its moments, by axis (3,) [m]."""
        return np.asarray(np.sqrt(12.0 * self.points.var(axis=0)))

    @cached_property
    def coarse(self) -> Cloud:
        """Every fourth point, each standing for four."""
        return replace(self, points=self.points[::4], share=self.share * len(self.points) / len(self.points[::4]))


def cloud_of(body: Body) -> Cloud:
    """Return points within a body, spread evenly, the same ones each time."""
    shape = canonical(body)
    low, high = shape.bounds
    scale = (high - low) / LATTICE
    grid = Grid(np.zeros(3), 1.0, (LATTICE, LATTICE, LATTICE))
    filled = occupancy((shape.vertices - low) / scale, shape.faces, grid)
    corners = np.argwhere(filled)
    if len(corners) < 8:
        corners = np.argwhere(np.ones(grid.shape, dtype=bool))
    within = np.modf(0.5 + np.arange(1, len(corners) + 1)[:, None] * IRRATIONAL)[0]
    points = low + (corners + within) * scale
    return Cloud(body, shape.world_from_fragment, points, body.volume / len(points))


def cells(cloud: Cloud, tree: Tree, volumes: Sequence[float] | None = None) -> np.ndarray:
    """Return the features (leaves, 4) of the fragments that a tree makes.

    Planes stand by thickness, after the weights; with `volumes` [m^3] of the leaves they stand so that each part has
    the volume of its leaves.
    """
    labels = np.zeros(len(cloud.points), dtype=np.int64)
    _label(
        cloud.points, np.arange(len(cloud.points)), tree, 0, None if volumes is None else np.asarray(volumes), labels
    )
    count = leaves(tree)
    number = np.bincount(labels, minlength=count).astype(float)
    some = np.maximum(number, 1.0)
    mean = np.stack([np.bincount(labels, cloud.points[:, k], count) for k in range(3)], axis=1) / some[:, None]
    off = cloud.points - mean[labels]
    covariance = np.zeros((count, 3, 3))
    for i in range(3):
        for j in range(i, 3):
            covariance[:, i, j] = covariance[:, j, i] = np.bincount(labels, off[:, i] * off[:, j], count) / some
    edges = np.maximum(box_edges(covariance), 1e-6)
    return np.column_stack([np.log(edges), np.log(np.maximum(number, 0.1) * cloud.share)])


def _label(
    points: np.ndarray, inside: np.ndarray, tree: Tree, first: int, volumes: np.ndarray | None, labels: np.ndarray
) -> None:
    if tree is None:
        labels[inside] = first
        return
    counts = [leaves(part) for part in tree.parts]
    starts = first + np.concatenate([[0], np.cumsum(counts)]).astype(int)
    along = points[inside, tree.axis]
    if volumes is None:
        marks = np.cumsum(tree.weights)[:-1] / np.sum(tree.weights)
        low, high = (along.min(), along.max()) if len(along) else (0.0, 0.0)
        places = low + (high - low) * marks
    else:
        wanted = np.array([volumes[a:b].sum() for a, b in zip(starts[:-1], starts[1:], strict=True)])
        marks = np.minimum((np.cumsum(wanted)[:-1] / wanted.sum() * len(along)).astype(int), len(along) - 1)
        places = np.partition(along, marks)[marks] if len(along) else np.zeros(len(counts) - 1)
    which = np.searchsorted(places, along)
    for number, part in enumerate(tree.parts):
        _label(points, inside[which == number], part, int(starts[number]), volumes, labels)

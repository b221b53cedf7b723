"""What a tree of cuts would make of a piece, foreseen on points within it: no mesh is cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.canonical import box_edges, canonical
from scenewright.stages.cutting.world.voxels import Grid, occupancy
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.geometry.transforms import apply, inverse

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
    slabs: bool = False
    """Planes stand by thickness, whatever volume the parts get."""

    @cached_property
    def count(self) -> int:
        """How many fragments it makes."""
        return sum(leaves(part) for part in self.parts)


Tree = Split | None
"""None: a fragment, left as it is."""


def leaves(tree: Tree) -> int:
    """Return how many fragments a tree makes."""
    return 1 if tree is None else tree.count


@dataclass(frozen=True)
class Cloud:
    """A piece as points (N, 3) in a frame of its own [m], each standing for the same volume."""

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


def cloud_of(body: Body, world_from_axes: np.ndarray | None = None) -> Cloud:
    """Return points within a body, spread evenly, the same ones each time; in its canonical frame, or in another."""
    frame = canonical(body).world_from_fragment if world_from_axes is None else world_from_axes
    vertices = apply(inverse(frame), body.vertices)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    scale = (high - low) / LATTICE
    grid = Grid(np.zeros(3), 1.0, (LATTICE, LATTICE, LATTICE))
    filled = occupancy((vertices - low) / scale, body.faces, grid)
    corners = np.argwhere(filled)
    if len(corners) < 8:
        corners = np.argwhere(np.ones(grid.shape, dtype=bool))
    within = np.modf(0.5 + np.arange(1, len(corners) + 1)[:, None] * IRRATIONAL)[0]
    points = low + (corners + within) * scale
    return Cloud(body, frame, points, body.volume / len(points))


def cells(cloud: Cloud, tree: Tree, volumes: Sequence[float] | None = None) -> np.ndarray:
    """Return the features (leaves, 4) of the fragments that a tree makes.

    Planes stand by thickness, after the weights; with `volumes` [m^3] of the leaves they stand so that each part has
    the volume of its leaves, but in slabs.
    """
    given = np.zeros(0) if volumes is None else np.asarray(volumes, float)
    number, covariance, _ = _moments(cloud.points, *_flat(tree), given, leaves(tree))
    edges = np.maximum(box_edges(covariance), 1e-6)
    return np.column_stack([np.log(edges), np.log(np.maximum(number, 0.1) * cloud.share)])


def spans(cloud: Cloud, tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges (leaves, 3) [m] by axis of the boxes around the fragments of a tree whose leaves get one volume
    each, but in slabs, and their volumes (leaves,) [m^3]."""
    number, _, between = _moments(cloud.points, *_flat(tree), np.ones(leaves(tree)), leaves(tree))
    along_edge = np.maximum(np.cbrt(number), 1.5)[:, None]  # points stand for more than what lies between them
    return np.maximum(between * along_edge / (along_edge - 1.0), 1e-6), np.maximum(number, 0.1) * cloud.share


def _flat(tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of a tree, breadth first: rows (axis, first child, children, first leaf, leaves, slabs),
    weights."""
    nodes: list[tuple[Tree, int]] = [(tree, 0)]
    rows, weights = [], [1.0]
    for node, leaf in nodes:  # grows as it is walked
        if node is None:
            rows.append((0, 0, 0, leaf, 1, 0))
            continue
        rows.append((node.axis, len(nodes), len(node.parts), leaf, node.count, int(node.slabs)))
        weights += node.weights
        for part in node.parts:
            nodes.append((part, leaf))
            leaf += leaves(part)
    return np.array(rows, dtype=np.int64), np.array(weights)


@compiled
def _moments(
    points: np.ndarray, nodes: np.ndarray, weights: np.ndarray, volumes: np.ndarray, leaves: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how many points each leaf gets, their covariance (leaves, 3, 3), and what they span (leaves, 3)."""
    order, spare = np.arange(len(points)), np.empty(len(points), dtype=np.int64)
    start, end = np.zeros(len(nodes), dtype=np.int64), np.zeros(len(nodes), dtype=np.int64)
    end[0] = len(points)
    number, mean, covariance = np.zeros(leaves), np.zeros((leaves, 3)), np.zeros((leaves, 3, 3))
    low, high = np.full((leaves, 3), np.inf), np.full((leaves, 3), -np.inf)
    for node in range(len(nodes)):
        axis, child, part_count, leaf, _, slabs = nodes[node]
        by_volume = len(volumes) > 0 and slabs == 0
        inside = order[start[node] : end[node]]
        if part_count == 0:
            number[leaf] = len(inside)
            for i in inside:
                for j in range(3):
                    mean[leaf, j] += points[i, j]
                    low[leaf, j] = min(low[leaf, j], points[i, j])
                    high[leaf, j] = max(high[leaf, j], points[i, j])
            mean[leaf] /= max(len(inside), 1)
            for i in inside:
                for j in range(3):
                    off = points[i, j] - mean[leaf, j]
                    for k in range(j + 1):
                        covariance[leaf, j, k] += off * (points[i, k] - mean[leaf, k])
            for j in range(3):
                for k in range(j + 1):
                    covariance[leaf, j, k] /= max(len(inside), 1)
                    covariance[leaf, k, j] = covariance[leaf, j, k]
            continue
        share = weights[child : child + part_count].copy()
        if by_volume:
            for k in range(part_count):
                share[k] = volumes[nodes[child + k, 3] : nodes[child + k, 3] + nodes[child + k, 4]].sum()
        marks = np.cumsum(share)[:-1] / share.sum()
        along = points[inside, axis]
        if len(along):
            if by_volume:
                ranked = np.sort(along)
                places = ranked[np.minimum((marks * len(along)).astype(np.int64), len(along) - 1)]
            else:
                places = along.min() + (along.max() - along.min()) * marks
            which = np.searchsorted(places, along)
            at = start[node]
            for k in range(part_count):
                start[child + k] = at
                for i in range(len(inside)):
                    if which[i] == k:
                        spare[at] = inside[i]
                        at += 1
                end[child + k] = at
            order[start[node] : end[node]] = spare[start[node] : end[node]]
    return number, covariance, np.maximum(high - low, 0.0)

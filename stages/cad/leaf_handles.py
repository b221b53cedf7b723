"""A handle in the map: a narrow thing that stands out of a flat leaf, on the side away from the hinge."""

from __future__ import annotations

import numpy as np
from scenewright.stages.cad.leaves import Leaf, Seen
from scenewright.stages.kit.geometry.point_clouds import linked

LEAST_HEIGHT, MOST_HEIGHT, NOISES = 0.015, 0.10, 4.0
"""A handle stands out by as much [m], and by so many times the noise of the front."""
APART = 0.035
"""Vertices of one handle are no farther from the next [m]."""
FEWEST = 4
"""Vertices of a handle."""
NARROW = 0.09
"""A handle is narrower than this in one direction, as the map shows it [m]."""
LEAST_FLAT, MOST_NOISE = 0.75, 0.008
"""A leaf is flat: this share of it lies on one plane, with no more noise than this [m]."""
LEAST_SEEN, CELL = 0.35, 0.03
"""Least share of a leaf that was seen, counted in cells of this edge [m]."""


def handle_height(leaf: Leaf, seen: Seen) -> float | None:
    """Return how far the handle that stands out of a leaf does so [m], None where there is none."""
    if seen.flat < LEAST_FLAT or seen.noise > MOST_NOISE or _seen_share(leaf, seen) < LEAST_SEEN:
        return None
    out = seen.within & (seen.heights > max(LEAST_HEIGHT, NOISES * seen.noise)) & (seen.heights < MOST_HEIGHT)
    points = np.column_stack([seen.places[out], seen.heights[out]])
    if len(points) < FEWEST:
        return None
    heights = [
        float(cluster[:, 2].max())
        for cluster in (points[rows] for rows in linked(points / APART))
        if len(cluster) >= FEWEST
        and np.ptp(cluster[:, :2], axis=0).min() < NARROW
        and _graspable(leaf, cluster[:, :2].mean(axis=0))
    ]
    return round(max(heights), 4) if heights else None


def _seen_share(leaf: Leaf, leaf_view: Seen) -> float:
    cells = np.unique(np.floor(leaf_view.places[leaf_view.front] / CELL).astype(int), axis=0)
    return float(len(cells) / np.prod(np.ceil(leaf.size / CELL)))


def _graspable(leaf: Leaf, position: np.ndarray) -> bool:
    """Whether a place (2,) of a leaf is on the half away from its hinge; anywhere, where it slides."""
    if leaf.joint.type == "prismatic":
        return True
    hinge = leaf.scale * np.asarray(leaf.joint.origin)[leaf.others] - leaf.low
    along = np.asarray(leaf.joint.axis)[leaf.others]
    across = int(np.argmin(np.abs(along)))
    return bool(abs(position[across] - hinge[across]) > 0.5 * leaf.size[across])

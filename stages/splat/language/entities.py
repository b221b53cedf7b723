"""Which entity of a panoptic map a piece of a splat belongs to: the one at whose surface most of its Gaussians lie."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

NONE = -1
"""Number that stands for no entity."""
REACH = 0.05
"""A Gaussian farther from every surface than this is of none [m]."""
MOST = 0.5
"""Share of a piece that its entity has, at least."""


def nearest_entities(means: np.ndarray, surfaces: Sequence[np.ndarray]) -> np.ndarray:
    """Return (N,) the entity nearest to each mean (N, 3), by number in `surfaces`, points (P, 3) each [m, world]; NONE
    where none is within REACH."""
    points = np.concatenate([np.zeros((0, 3)), *surfaces])
    if not len(points) or not len(means):
        return np.full(len(means), NONE)
    owners = np.repeat(np.arange(len(surfaces)), [len(surface) for surface in surfaces])
    distances, nearest = cKDTree(points).query(means, distance_upper_bound=REACH)
    return np.where(np.isfinite(distances), owners[np.minimum(nearest, len(owners) - 1)], NONE)


def entity_of(owners: np.ndarray) -> int:
    """Return the entity that at least MOST of a piece's Gaussians are of, by their owners (K,); NONE: there is none."""
    known_owners = owners[owners != NONE]
    if not len(known_owners):
        return NONE
    best = int(np.bincount(known_owners).argmax())
    return best if (owners == best).mean() >= MOST else NONE

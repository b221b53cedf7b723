"""Splats have strays: Gaussians far from all others, which no box or picture of the whole should reach out to."""

from __future__ import annotations

import numpy as np

MIDDLE = (2.0, 98.0)
"""Percentiles of each axis between which a Gaussian is no stray."""
FEW = 50
"""Number of Gaussians up to which all count."""


def no_strays(points: np.ndarray) -> np.ndarray:
    """Return which (N,) bool of points (N, 3) are no strays; all, where they are few or none were left."""
    every = np.ones(len(points), bool)
    if len(points) <= FEW:
        return every
    low, high = (np.percentile(points, share, axis=0) for share in MIDDLE)
    within = ((points >= low) & (points <= high)).all(axis=1)
    return within if within.any() else every

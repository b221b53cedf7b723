"""Balls and capsules as convex polyhedra; boxes and cylinders are in the kit."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.solids import Solid, hull

RINGS, SIDES = 6, 16
"""Steps from pole to pole of a sphere, and points around it; by eye."""


def ball(radii: np.ndarray) -> Solid:
    """Return an ellipsoid with the given half axes (3,), inscribed, all of it curved."""
    return hull(_sphere() * np.asarray(radii, dtype=float), curved=True)


def capsule(radius: float, half_length: float) -> Solid:
    """Return a capsule along z: a cylinder from -half_length to half_length with half balls on its ends."""
    sphere, shift = _sphere(), np.array([0.0, 0.0, half_length])
    upper, lower = radius * sphere[sphere[:, 2] > -1e-12] + shift, radius * sphere[sphere[:, 2] < 1e-12] - shift
    return hull(np.concatenate([lower, upper]), curved=True)


def _sphere() -> np.ndarray:
    """Return points on the unit sphere: poles, and rings with one of them on the equator."""
    height = np.sin(np.linspace(-0.5, 0.5, RINGS + 1)[1:-1] * np.pi)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    rings = [
        np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(SIDES, z)])
        for z, r in zip(height, np.sqrt(1 - height**2), strict=True)
    ]
    return np.concatenate([[[0.0, 0.0, -1.0]], *rings, [[0.0, 0.0, 1.0]]])

"""Where straight lines enter convex solids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.kit.geometry.solids import Solid

PARALLEL = 1e-9
"""Slope below which a ray counts as parallel to a plane; rounding."""
SEAM = 1e-9
"""A ray along the seam between two solids hits them, whatever rounding says [m]."""


class SolidRays:
    """Convex solids ready for rays: their face planes, padded to one table."""

    def __init__(self, solids: Sequence[Solid]) -> None:
        count = max(len(solid.faces) for solid in solids)
        self.normals = np.zeros((len(solids), count, 3))
        self.offsets = np.full((len(solids), count), -1.0)  # a padded face has everything inside: 0.v - 1 < 0
        for k, solid in enumerate(solids):
            corners = solid.vertices[solid.faces]
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            length = np.linalg.norm(cross, axis=1)
            sound = length > 1e-14
            normals = cross[sound] / length[sound, None]
            self.normals[k, : len(normals)] = normals
            self.offsets[k, : len(normals)] = -np.einsum("fi,fi->f", corners[sound, 0], normals)

    def distances(self, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return (R, S): how far rays from origins (R, 3) along a unit vector (3,) run until they enter each solid [m].

        0 for an origin inside, infinite for a miss.
        """
        slope = self.normals @ direction
        height = np.einsum("ri,sfi->rsf", origins, self.normals) + self.offsets
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -height / slope
        enters = np.where(slope < -PARALLEL, crossing, -np.inf).max(axis=2)
        leaves = np.where(slope > PARALLEL, crossing, np.inf).min(axis=2)
        outside = ((np.abs(slope) <= PARALLEL) & (height > SEAM)).any(axis=2)
        hit = ~outside & (enters <= leaves + SEAM) & (leaves > 0)
        return np.where(hit, np.maximum(enters, 0.0), np.inf)

"""The canonical frame of a fragment (Han 2024, section 6.3.4) and what does not depend on its pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.voxels import Grid, occupancy
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from

OCTANT_VOXELS = 24
"""Voxels along the longest edge, by which the octant that holds most is told; by eye."""
TURNS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
"""Signs of the axes that keep the frame right-handed."""


@dataclass(frozen=True)
class Canonical:
    """A fragment in its own frame: x along its shortest, z along its longest principal axis."""

    world_from_fragment: np.ndarray
    """(4, 4); the origin is the centre of the volume."""
    vertices: np.ndarray
    """(V, 3) in the frame [m]."""
    faces: np.ndarray
    volume: float

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corner (3,) [m]."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @property
    def size(self) -> np.ndarray:
        """Edges of the box around it (3,) [m]."""
        low, high = self.bounds
        return np.asarray(high - low)

    def voxels(self, voxel: float) -> tuple[Grid, np.ndarray]:
        """Return a grid of voxels of this edge [m] around it, and which of them it fills."""
        grid = Grid.around(*self.bounds, voxel)
        return grid, occupancy(self.vertices, self.faces, grid)


def canonical(body: Body) -> Canonical:
    """Return a body in its canonical frame: of the four ways to turn it, that with most volume in the first octant."""
    center, covariance = body.moments
    _, axes = np.linalg.eigh(covariance)
    for k in range(3):  # eigenvectors have no sign of their own
        axes[:, k] *= np.sign(axes[np.argmax(np.abs(axes[:, k])), k])
    if np.linalg.det(axes) < 0:
        axes[:, 2] *= -1
    frame = transform_from(axes, center)
    vertices = apply(inverse(frame), body.vertices)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    grid = Grid.around(low, high, float((high - low).max()) / OCTANT_VOXELS)
    filled = occupancy(vertices, body.faces, grid)
    middle = np.clip(np.round(-grid.origin / grid.voxel).astype(int), 0, grid.shape)
    most = [_octant(filled, middle, turn) for turn in TURNS]
    turn = TURNS[int(np.argmax(most))].astype(float)
    return Canonical(transform_from(axes * turn, center), vertices * turn, body.faces, body.volume)


def axis_across(body: Body, normal: np.ndarray) -> int:
    """Return the axis of a body (0 the shortest) that a plane with this normal (3,) cuts across."""
    axes = canonical(body).world_from_fragment[:3, :3]
    return int(np.argmax(np.abs(axes.T @ normal)))


def _octant(filled: np.ndarray, middle: np.ndarray, signs: np.ndarray) -> int:
    half_spaces = tuple(slice(m, None) if s > 0 else slice(0, m) for m, s in zip(middle, signs, strict=True))
    return int(filled[half_spaces].sum())


def box_edges(covariance: np.ndarray) -> np.ndarray:
    """Return the edges, shortest first (..., 3) [m], of the box that has covariances (..., 3, 3) [m^2]."""
    return np.asarray(np.sqrt(12.0 * np.maximum(np.linalg.eigvalsh(covariance), 1e-18)))

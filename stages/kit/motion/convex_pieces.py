"""The collision shapes of a URDF as convex pieces: what Bullet makes of them, the hull of each shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scenewright.stages.kit.motion.sphere_cover import enclosing_ball, hull_vertices, sphere_cover
from scenewright.stages.kit.simulation.shapes import link_shapes

MOST_BALLS = 10
"""Most balls that cover a piece; by eye."""
SMALLEST_BALL = 0.045
"""Balls are not made smaller than this radius [m]; the hulls themselves decide what is finer."""


@dataclass(frozen=True)
class ConvexPiece:
    """A convex hull in the frame of its link. Round shapes lie inside it."""

    vertices: np.ndarray
    """(V, 3)"""

    @cached_property
    def bound(self) -> np.ndarray:
        """(4,) centre and radius of a ball around it."""
        return enclosing_ball(self.vertices)

    @cached_property
    def spheres(self) -> np.ndarray:
        """(S, 4) balls whose union holds it."""
        return sphere_cover(self.vertices, MOST_BALLS, SMALLEST_BALL)

    @cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """link_from_box (4, 4) and half sides (3,) of a box around it: upright or along its principal axes."""
        around = self.vertices - self.vertices.mean(axis=0)
        if len(around) < 3:  # a point or a line has principal axes too
            around = np.vstack([around, np.zeros((3 - len(around), 3))])
        principal = np.linalg.svd(around, full_matrices=False)[2]
        if np.linalg.det(principal) < 0:
            principal[2] *= -1
        best: tuple[np.ndarray, np.ndarray] | None = None
        for axes in (np.eye(3), principal):
            along = self.vertices @ axes.T
            low, high = along.min(axis=0), along.max(axis=0)
            half = (high - low) / 2
            if best is None or np.prod(half + 1e-3) < 0.98 * np.prod(best[1] + 1e-3):
                pose = np.eye(4)
                pose[:3, :3] = axes.T
                pose[:3, 3] = axes.T @ ((low + high) / 2)
                best = pose, half
        assert best is not None
        return best


@lru_cache(maxsize=512)
def link_pieces(text: str) -> dict[str, tuple[ConvexPiece, ...]]:
    """Return the pieces of each link of URDF text with absolute mesh paths; kept between calls. Raises BadInput."""
    shapes = link_shapes(text, around=True)
    return {
        link: tuple(ConvexPiece(hull_vertices(np.asarray(mesh.vertices, dtype=float))) for mesh in meshes)
        for link, meshes in shapes.items()
    }

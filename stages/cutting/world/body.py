"""Closed bodies that planes cut exactly: capped by manifold3d, in double precision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import manifold3d
import numpy as np
from scenewright.stages.kit.geometry.transforms import transform_from

DUST = 1e-12
"""Volume [m^3] up to which a piece is none: a thousandth of a cubic millimetre."""


@dataclass(frozen=True)
class Plane:
    """n . x + d = 0 (Han 2024, section 6.3), n of length 1, d [m]."""

    normal: np.ndarray
    """(3,)."""
    d: float

    def height(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (N, 3) lie on the side of the normal [m], (N,)."""
        return points @ self.normal + self.d

    def moved(self, target_from_source: np.ndarray) -> Plane:
        """Return the plane under a rigid (4, 4) transform."""
        normal = target_from_source[:3, :3] @ self.normal
        return Plane(normal, self.d - float(normal @ target_from_source[:3, 3]))

    @staticmethod
    def through(point: np.ndarray, normal: np.ndarray) -> Plane:
        """Return the plane through a point (3,) [m] with a normal (3,) of any length but zero."""
        unit = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
        return Plane(unit, -float(unit @ point))


class Body:
    """A closed body of one piece, in metres. Cutting and moving give new bodies, which know how they were moved."""

    def __init__(self, solid: manifold3d.Manifold, world_from_first: np.ndarray | None = None) -> None:
        self.solid = solid
        self.world_from_first = np.eye(4) if world_from_first is None else world_from_first
        """Rigid (4, 4), from where the mesh lay out of which it was made or cut."""

    @staticmethod
    def of_mesh(vertices: np.ndarray, faces: np.ndarray) -> Body:
        """Return the body that a closed, outward oriented mesh (V, 3), (F, 3) encloses.

        Raises ValueError with the library's word for what is wrong: not manifold, not finite, without volume.
        """
        mesh = manifold3d.Mesh64(
            np.ascontiguousarray(vertices, dtype=np.float64), np.ascontiguousarray(faces, dtype=np.uint64)
        )
        solid = manifold3d.Manifold(mesh)
        if solid.status() != manifold3d.Error.NoError:
            raise ValueError(solid.status().name)
        if not solid.volume() > 0.0:
            raise ValueError("no volume, or turned inside out")
        return Body(solid)

    @cached_property
    def volume(self) -> float:
        """Volume [m^3]."""
        return float(self.solid.volume())

    @cached_property
    def _mesh(self) -> tuple[np.ndarray, np.ndarray]:
        mesh = self.solid.to_mesh64()
        return np.array(mesh.vert_properties[:, :3]), np.asarray(mesh.tri_verts).astype(np.int64)

    @property
    def vertices(self) -> np.ndarray:
        """(V, 3) [m]."""
        return self._mesh[0]

    @property
    def faces(self) -> np.ndarray:
        """(F, 3), outward counter-clockwise."""
        return self._mesh[1]

    @cached_property
    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Centre of the volume (3,) [m] and covariance of the points within (3, 3) [m^2]; exact, by tetrahedra."""
        origin = self.vertices.mean(axis=0)
        corners = (self.vertices - origin)[self.faces]
        determinant = np.linalg.det(corners)
        volume = determinant.sum() / 6.0
        first = np.einsum("f,fij->j", determinant, corners) / 24.0 / volume
        canonical = (np.ones((3, 3)) + np.eye(3)) / 120.0
        second = np.einsum("f,fai,ab,fbj->ij", determinant, corners, canonical, corners) / volume
        return origin + first, second - np.outer(first, first)

    def extent_along(self, direction: np.ndarray) -> tuple[float, float]:
        """Return the least and greatest coordinate along a unit direction (3,) [m]."""
        along = self.vertices @ direction
        return float(along.min()), float(along.max())

    def moved(self, target_from_source: np.ndarray) -> Body:
        """Return the body under a rigid (4, 4) transform."""
        moved_by = np.asarray(target_from_source, dtype=float)
        return Body(self.solid.transform(moved_by[:3, :]), moved_by @ self.world_from_first)

    def shifted(self, by: np.ndarray) -> Body:
        """Return the body moved by (3,) [m]."""
        by = np.asarray(by, dtype=float)
        return Body(self.solid.translate(by), transform_from(np.eye(3), by) @ self.world_from_first)

    def grown(self, share: float) -> Body:
        """Return the body larger by a share, about the centre of its volume."""
        center = self.moments[0]
        return Body(self.solid.translate(-center).scale([1.0 + share] * 3).translate(center), self.world_from_first)

    def within(self, world_from_box: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
        """Return the volume [m^3] of what lies in the box from `low` to `high` (3,) [m] of a rigid frame (4, 4)."""
        box = manifold3d.Manifold.cube(np.asarray(high - low, dtype=float)).translate(np.asarray(low, dtype=float))
        return float((self.solid ^ box.transform(world_from_box[:3, :])).volume())

    def halves(self, plane: Plane) -> tuple[list[Body], list[Body]]:
        """Return the pieces on the side of the normal and on the other; a bent body may fall into more than two."""
        sides = self.solid.split_by_plane(plane.normal, -plane.d)
        return pieces(sides[0], self.world_from_first), pieces(sides[1], self.world_from_first)

    def section(self, plane: Plane) -> np.ndarray:
        """Return the points (N, 3) where edges cross the plane [m]; none where it misses."""
        height = plane.height(self.vertices)
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        crossing = edges[(height[edges[:, 0]] > 0) & (height[edges[:, 1]] <= 0)]
        above, below = height[crossing[:, 0]], height[crossing[:, 1]]
        share = (above / (above - below))[:, None]
        return self.vertices[crossing[:, 0]] * (1 - share) + self.vertices[crossing[:, 1]] * share


def pieces(solid: manifold3d.Manifold, world_from_first: np.ndarray | None = None) -> list[Body]:
    """Return the connected pieces of a solid, largest first, but for what rounding leaves of faces in a plane."""
    if solid.is_empty():
        return []
    bodies = [Body(part, world_from_first) for part in solid.decompose() if part.volume() > DUST]
    return sorted(bodies, key=lambda body: -body.volume)


def unite(bodies: Sequence[Body]) -> list[Body]:
    """Return the connected pieces of the union of bodies, largest first."""
    return pieces(manifold3d.Manifold.batch_boolean([body.solid for body in bodies], manifold3d.OpType.Add))

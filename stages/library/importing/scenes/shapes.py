"""Shapes to touch, as every format has them: boxes, round ones, and convex hulls of meshes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.urdf_file import Primitive, Shape
from scenewright.stages.kit.geometry.solids import Solid, hull_or_box
from scenewright.stages.kit.geometry.transforms import apply, transform_from

GROUND_SIZE, GROUND_DEPTH = 100.0, 1.0
"""A plane collides as a box of this size below it [m]."""


HOLLOW = 0.005
"""A mesh is spoken of when a corner of it lies deeper in its hull [m]: as deep as bodies that collide."""
MOST_CORNERS = 2000
"""Corners of a mesh that are looked at."""


@dataclass
class Hulls:
    """Convex hulls that shapes name, by the file that they are written to."""

    findings: list[str]
    solids: dict[str, Solid] = field(default_factory=dict)

    def shape(self, points: np.ndarray, name: str = "") -> Shape:
        """Return the hull of points (N, 3) [m], link frame, as a shape; say of the mesh `name` when it is hollow."""
        file = f"meshes/hull_{len(self.solids)}.obj"
        self.solids[file] = hull_or_box(points)
        depth = _depth_in(self.solids[file], points[:: 1 + len(points) // MOST_CORNERS]) if name else 0.0
        if depth > HOLLOW:
            self.findings.append(f"mesh {name!r:.80} collides as its hull, up to {1000 * depth:.0f} mm off its surface")
        return Shape(mesh=file)

    def bounds(self, shape: Shape) -> np.ndarray:
        """Return corners (N, 3) of a shape's bounds, link frame [m]."""
        if shape.mesh is not None:
            return apply(shape.link_from_shape, self.solids[shape.mesh].vertices)
        if shape.box_size is not None:
            half = np.asarray(shape.box_size) / 2
        else:
            assert shape.round is not None
            radius, length = (*shape.round.sizes, 0.0)[:2]
            height = {"sphere": radius, "cylinder": length / 2, "capsule": length / 2 + radius}[shape.round.kind]
            half = np.array([radius, radius, height])
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return apply(shape.link_from_shape, signs * half)


def solid_shape(kind: str, sizes: np.ndarray, link_from_shape: np.ndarray, where: str) -> Shape:
    """Return a `box` of full sizes, or a `sphere`, `cylinder` or `capsule` of radius and length [m].

    Raises BadInput, beginning with `where`, for one without size.
    """
    values = [float(value) for value in sizes]
    if not 0 < min(values) <= max(values) < 1e6:
        raise BadInput(f"{where}: a {kind} without size")
    if kind == "box":
        x, y, z = values
        return Shape(box_size=(x, y, z), link_from_shape=link_from_shape)
    return Shape(round=Primitive(kind, tuple(values)), link_from_shape=link_from_shape)


def ground_shape(link_from_plane: np.ndarray) -> Shape:
    """Return a plane's upper side (its z) as that of a large box."""
    below = transform_from(np.eye(3), np.array([0.0, 0.0, -GROUND_DEPTH / 2]))
    return Shape(box_size=(GROUND_SIZE, GROUND_SIZE, GROUND_DEPTH), link_from_shape=link_from_plane @ below)


def _depth_in(solid: Solid, points: np.ndarray) -> float:
    """Return how deep [m] the deepest of points (N, 3) lies in a convex solid."""
    corners = solid.vertices[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals, corner = normals[lengths > 0] / lengths[lengths > 0, None], corners[lengths > 0, 0]
    offsets = np.einsum("ij,ij->i", normals, corner)
    return float(max((np.min(offsets - normals @ point) for point in points), default=0.0))

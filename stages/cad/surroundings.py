"""What was mapped and belongs to nothing: it has no name, but nothing can be where it is.

Segmentation names what it knows; counters, curtains and whatever it missed stay in the map without an instance. A scene
without them is one in which a robot drives through a kitchen counter. They become a static body: the surface as it was
mapped, but for what lies within reach of something that has a model or a mesh (mostly its own rim).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.box_cover import cover_with_boxes
from scenewright.stages.kit.geometry.convex_solids import Solid, convex_solid, penetration
from scipy.spatial import ConvexHull, QhullError

Piece = tuple[np.ndarray, np.ndarray]
"""Vertices (V, 3) and faces (F, 3) of a convex polyhedron, world frame."""
MARGIN = 0.005
"""Boxes are asked for this much larger on every side [m]: the exported scene differs a little from the shapes here."""
FOOTING = 0.05
"""Depth [m] below a thing in which the exported scene may put a pad that bears it."""
ROUNDS = 6
"""Times that boxes are laid over what is left, as other boxes come of it."""
POINTS_AT_ONCE = 4096
"""Points whose distance to a convex piece is computed in one go."""


@dataclass(frozen=True)
class Convex:
    """A convex polyhedron as half-spaces: normals (K, 3) outwards, offsets (K,), and its bounds."""

    normals: np.ndarray
    offsets: np.ndarray
    low: np.ndarray
    high: np.ndarray


def convex_of(vertices: np.ndarray) -> Convex:
    """Return the hull of vertices (V, 3) [m] as half-spaces; their bounding box where they are flat."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    try:
        equations = np.unique(ConvexHull(vertices).equations, axis=0)  # the triangles of a side have one and the same
        return Convex(equations[:, :3], -equations[:, 3], low, high)
    except QhullError:
        normals = np.concatenate([np.eye(3), -np.eye(3)])
        return Convex(normals, np.concatenate([high, -low]), low, high)


def near_any(points: np.ndarray, pieces: Iterable[Convex], distance: float) -> np.ndarray:
    """Return (N,) bool: points (N, 3) inside a piece, or less than `distance` [m] before the planes of all its sides.

    Beside edges and corners that is a little more than the Euclidean distance allows.
    """
    is_near = np.zeros(len(points), dtype=bool)
    for piece in pieces:
        undecided = ~is_near & np.all((points > piece.low - distance) & (points < piece.high + distance), axis=1)
        rows = np.flatnonzero(undecided)
        for start in range(0, len(rows), POINTS_AT_ONCE):
            some = rows[start : start + POINTS_AT_ONCE]
            is_near[some] = np.all(points[some] @ piece.normals.T - piece.offsets < distance, axis=1)
    return is_near


def nameless_surface(
    mesh: EntityMesh,
    instance: np.ndarray,
    pieces: Sequence[Piece],
    *,
    clearance: float,
    smallest_area: float,
    tolerance: float,
) -> EntityMesh | None:
    """Return the surface of the map that has no instance, world frame; None when there is none.

    `instance` (V,): per vertex of the map, 0 for none; `pieces`: convex pieces of what stands in the scene. Left out:
    what is within `clearance` [m] of a piece, connected patches of less than `smallest_area` [m²], and what would stand
    deeper than `tolerance` [m] in a piece once boxes cover it.
    """
    faces = mesh.faces[np.all(instance[mesh.faces] == 0, axis=1)]
    centers = mesh.vertices[faces].mean(axis=1)
    faces = faces[~near_any(centers, [convex_of(vertices) for vertices, _ in pieces], clearance)]
    faces = _large_patches(mesh.vertices, faces, smallest_area)
    scene = convex_solid(list(pieces))
    for _ in range(ROUNDS):
        if len(faces) == 0:
            return None
        surface = compact(mesh, faces)
        inside = _in_boxes_that_collide(surface, scene, tolerance)
        if not inside.any():
            return surface
        faces = faces[~inside]
    return None if len(faces) == 0 else compact(mesh, faces)


def footing(pieces: Sequence[Piece]) -> Piece:
    """Return the box under the convex pieces of a thing, `FOOTING` [m] high: what it stands on has a name."""
    points = np.concatenate([vertices for vertices, _ in pieces])
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.array([*(high - low)[:2], FOOTING])
    box = trimesh.creation.box(extents=size)
    return np.asarray(box.vertices) + [*(0.5 * (low + high))[:2], low[2] - 0.5 * FOOTING], np.asarray(box.faces)


def _large_patches(vertices: np.ndarray, faces: np.ndarray, smallest_area: float) -> np.ndarray:
    """Return the faces (F, 3) of connected patches that are large enough."""
    if len(faces) == 0:
        return faces
    component = trimesh.graph.connected_component_labels(
        np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]]), node_count=len(vertices)
    )[faces[:, 0]]
    corners = vertices[faces]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return faces[np.bincount(component, weights=areas)[component] >= smallest_area]


def _in_boxes_that_collide(surface: EntityMesh, scene: Solid, tolerance: float) -> np.ndarray:
    """Return (F,) bool: triangles in those of the boxes over the surface that stand in something of the scene.

    They are the boxes that the exported scene will have.
    """
    centers = surface.vertices[surface.faces].mean(axis=1)
    inside = np.zeros(len(centers), dtype=bool)
    for center, size in cover_with_boxes(trimesh.Trimesh(surface.vertices, surface.faces, process=False)):
        box = trimesh.creation.box(extents=size + 2 * MARGIN)
        solid = convex_solid([(np.asarray(box.vertices) + center, np.asarray(box.faces))])
        if penetration(solid, scene).depth > tolerance:
            inside |= np.all(np.abs(centers - center) < 0.5 * size + 0.01, axis=1)
    return inside


def compact(mesh: EntityMesh, faces: np.ndarray) -> EntityMesh:
    """Return the faces with the vertices that they use."""
    used, number = np.unique(faces, return_inverse=True)
    return EntityMesh(mesh.vertices[used], number.reshape(faces.shape), mesh.colors[used])

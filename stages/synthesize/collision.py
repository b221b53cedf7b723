"""Convex pieces in the world and whether they touch: boxes first, then the distance of convex pairs (FCL, GJK)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import fcl
import numpy as np
import trimesh
from scenewright.stages.kit.geometry.transforms import apply


@dataclass(frozen=True)
class ConvexShape:
    """Convex pieces that move together, in a frame of their own."""

    vertices: tuple[np.ndarray, ...]
    """Each (V, 3) [m]."""
    geometry: tuple[fcl.Convex, ...]

    def placed(self, world_from_shape: np.ndarray) -> PlacedShape:
        """Return the shape at a pose (4, 4)."""
        rotation, shift = world_from_shape[:3, :3], world_from_shape[:3, 3]
        objects = tuple(fcl.CollisionObject(g, fcl.Transform(rotation, shift)) for g in self.geometry)
        moved = [apply(world_from_shape, v) for v in self.vertices]
        minimum = np.array([v.min(axis=0) for v in moved])
        maximum = np.array([v.max(axis=0) for v in moved])
        return PlacedShape(objects, minimum, maximum, minimum.min(axis=0), maximum.max(axis=0))


@dataclass(frozen=True)
class PlacedShape:
    """Pieces in the world with their bounds."""

    objects: tuple[fcl.CollisionObject, ...]
    minimum: np.ndarray
    """(K, 3) [m]."""
    maximum: np.ndarray
    whole_minimum: np.ndarray
    """(3,) of all pieces."""
    whole_maximum: np.ndarray


def convex_shape(pieces: Iterable[trimesh.Trimesh]) -> ConvexShape:
    """Build a shape from convex meshes [m]."""
    vertices, geometry = [], []
    for piece in pieces:
        points = np.asarray(piece.vertices, dtype=np.float64)
        faces = np.asarray(piece.faces, dtype=np.int64)
        flat = np.column_stack([np.full(len(faces), 3), faces]).reshape(-1)
        vertices.append(points)
        geometry.append(fcl.Convex(points, len(faces), flat))
    return ConvexShape(tuple(vertices), tuple(geometry))


def box_shape(minimum: np.ndarray, maximum: np.ndarray) -> ConvexShape:
    """Return one axis-aligned box as a shape."""
    return convex_shape([trimesh.creation.box(bounds=np.stack([minimum, maximum]))])


def piece_distance(a: fcl.CollisionObject, b: fcl.CollisionObject) -> float:
    """Return the distance of two convex pieces [m], 0 when they touch or overlap."""
    if fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()) > 0:
        return 0.0
    return max(0.0, fcl.distance(a, b, fcl.DistanceRequest(), fcl.DistanceResult()))


class CollisionWorld:
    """Named shapes in the world."""

    def __init__(self) -> None:
        self.shapes: dict[str, PlacedShape] = {}

    def add(self, name: str, shape: PlacedShape) -> None:
        """Add or replace a shape."""
        self.shapes[name] = shape

    def conflict(
        self,
        shape: PlacedShape,
        margin: float = 0.0,
        *,
        without: Iterable[str] = (),
        margins: dict[str, float] | None = None,
    ) -> str | None:
        """Return the name of the first shape that is closer than the margin [m], or None. Touching is a conflict.

        `margins` replaces the margin for the shapes it names.
        """
        skipped = set(without)
        for name, other in self.shapes.items():
            if name in skipped:
                continue
            reach = (margins or {}).get(name, margin)
            if (shape.whole_minimum - reach > other.whole_maximum).any():
                continue
            if (other.whole_minimum > shape.whole_maximum + reach).any():
                continue
            close_pairs = np.all(
                (shape.minimum[:, None] - reach <= other.maximum[None])
                & (other.minimum[None] <= shape.maximum[:, None] + reach),
                axis=2,
            )
            for i, j in np.argwhere(close_pairs):
                if piece_distance(shape.objects[i], other.objects[j]) <= reach:
                    return name
        return None

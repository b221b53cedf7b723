"""Convex solids and what follows from their volume: mass, centre, inertia. Hollow things are sets of convex solids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply
from scipy.spatial import ConvexHull, QhullError


@dataclass(frozen=True)
class Solid:
    """A convex polyhedron with outward counter-clockwise triangles."""

    vertices: np.ndarray
    """(V, 3) [m]."""
    faces: np.ndarray
    """(F, 3) int."""
    curved: np.ndarray
    """(F,) bool: facets that stand for a curved surface (no surface planes)."""

    def moved(self, target_from_source: np.ndarray) -> Solid:
        """Return the solid under a rigid (4, 4) transform."""
        return replace(self, vertices=apply(target_from_source, self.vertices))

    def shifted(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Return the solid moved by (x, y, z) [m]."""
        return replace(self, vertices=self.vertices + np.array([x, y, z]))


@dataclass(frozen=True)
class MassProperties:
    """Mass [kg], centre (3,) [m], inertia (3, 3) [kg m^2] about the centre, axes of the frame they were asked in."""

    mass: float
    center: np.ndarray
    inertia: np.ndarray

    def scaled(self, scale: float) -> MassProperties:
        """Return those of the same thing, uniformly `scale` times larger and equally dense: s^3, s, s^5."""
        return MassProperties(self.mass * scale**3, self.center * scale, self.inertia * scale**5)


def hull(points: np.ndarray, *, curved: bool = False) -> Solid:
    """Return the convex hull of points (N, 3), vertices in the order given, inner points left out.

    Coplanar hull facets keep whatever triangulation qhull chooses; `curved` marks all of them.
    """
    points = np.asarray(points, dtype=float)
    convex = ConvexHull(points)
    used = np.sort(convex.vertices)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    corners = points[convex.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, convex.equations[:, :3]) < 0
    simplices = convex.simplices.copy()
    simplices[inward] = simplices[inward][:, ::-1]
    faces = number[simplices]
    start = np.argmin(faces, axis=1)
    faces = np.stack([faces[np.arange(len(faces)), (start + k) % 3] for k in range(3)], axis=1)
    faces = faces[np.lexsort(faces.T[::-1])]
    return Solid(points[used], faces, np.full(len(faces), curved))


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Solid:
    """Return the axis-aligned box between the given bounds [m] on each axis. Raises ValueError when one is empty."""
    lower, upper = np.array([x[0], y[0], z[0]], dtype=float), np.array([x[1], y[1], z[1]], dtype=float)
    if not (upper > lower).all():
        raise ValueError(f"box is empty: {x}, {y}, {z}")
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    faces = [
        (0, 1, 3),
        (0, 3, 2),
        (4, 6, 7),
        (4, 7, 5),
        (0, 4, 5),
        (0, 5, 1),
        (2, 3, 7),
        (2, 7, 6),
        (0, 2, 6),
        (0, 6, 4),
        (1, 5, 7),
        (1, 7, 3),
    ]
    return Solid(lower + corners * (upper - lower), np.array(faces), np.zeros(12, dtype=bool))


def hull_or_box(points: np.ndarray) -> Solid:
    """Return the convex hull of points (N, 3) [m], or, where they are flatter than 2 mm, the box around them, at least
    5 mm thick."""
    try:
        solid = hull(np.unique(points, axis=0))
        if np.ptp(solid.vertices, axis=0).min() >= 2e-3 and volume(solid) > 0.0:
            return solid
    except (QhullError, ValueError):
        pass
    low, high = points.min(axis=0), points.max(axis=0)
    middle, extent = 0.5 * (low + high), np.maximum(0.5 * (high - low), 2.5e-3)
    low, high = middle - extent, middle + extent
    return box((low[0], high[0]), (low[1], high[1]), (low[2], high[2]))


def prism(
    outline: np.ndarray, z: tuple[float, float], top_outline: np.ndarray | None = None, *, round_sides: bool = False
) -> Solid:
    """Return the solid between a convex counter-clockwise outline (N, 2) at z[0] and one (N, 2) at z[1] [m].

    `round_sides` marks the N side facets as a curved surface; bottom and top stay flat.
    """
    outline = np.asarray(outline, dtype=float)
    top = outline if top_outline is None else np.asarray(top_outline, dtype=float)
    count = len(outline)
    vertices = np.concatenate(
        [np.column_stack([outline, np.full(count, z[0])]), np.column_stack([top, np.full(count, z[1])])]
    )
    corner = np.arange(count)
    ahead = (corner + 1) % count
    sides = np.concatenate(
        [np.column_stack([corner, ahead, ahead + count]), np.column_stack([corner, ahead + count, corner + count])]
    )
    fan = np.column_stack([np.zeros(count - 2, dtype=int), np.arange(1, count - 1), np.arange(2, count)])
    faces = np.concatenate([fan[:, ::-1], fan + count, sides])
    curved = np.concatenate([np.zeros(2 * (count - 2), dtype=bool), np.full(2 * count, round_sides)])
    return Solid(vertices, faces, curved)


def circle(radius: float, count: int = 16, center: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Return `count` points (count, 2) on a circle [m], counter-clockwise, first at angle 0."""
    angle = 2 * np.pi * np.arange(count) / count
    return np.column_stack([center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)])


def cylinder(
    radius: float,
    z: tuple[float, float],
    center: tuple[float, float] = (0.0, 0.0),
    *,
    top_radius: float | None = None,
    count: int = 16,
) -> Solid:
    """Return an upright cylinder (or truncated cone with `top_radius`) of `count` sides [m]."""
    upper = radius if top_radius is None else top_radius
    return prism(circle(radius, count, center), z, circle(upper, count, center), round_sides=True)


def bar(start: np.ndarray, end: np.ndarray, radius: float, count: int = 12) -> Solid:
    """Return a round bar of the given radius between two points (3,) [m]."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    direction = end - start
    length = float(np.linalg.norm(direction))
    direction = direction / length
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    side = np.cross(direction, helper)
    side /= np.linalg.norm(side)
    up = np.cross(direction, side)
    upright = cylinder(radius, (0.0, length), count=count)
    frame = np.stack([side, up, direction])
    return replace(upright, vertices=start + upright.vertices @ frame)


def rounded_rectangle(x: tuple[float, float], y: tuple[float, float], radius: float, count: int = 4) -> np.ndarray:
    """Return the convex outline (4 * count, 2) of a rectangle [m] whose corners are arcs of `count` points."""
    radius = min(radius, 0.499 * (x[1] - x[0]), 0.499 * (y[1] - y[0]))
    points = []
    corners = [
        (x[1] - radius, y[1] - radius),
        (x[0] + radius, y[1] - radius),
        (x[0] + radius, y[0] + radius),
        (x[1] - radius, y[0] + radius),
    ]
    for quarter, (cx, cy) in enumerate(corners):
        for step in range(count):
            angle = 0.5 * np.pi * (quarter + step / (count - 1))
            points.append((cx + radius * np.cos(angle), cy + radius * np.sin(angle)))
    return np.array(points)


def cushion(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], bevel: float) -> Solid:
    """Return a box [m] with all edges bevelled by `bevel`: the hull of three slabs, each shrunk on two axes."""
    points = []
    bounds = np.array([x, y, z], dtype=float)
    for axis in range(3):
        slab = bounds.copy()
        for other_axis in range(3):
            if other_axis != axis:
                slab[other_axis] += (bevel, -bevel)
        points.extend([(a, b, c) for a in slab[0] for b in slab[1] for c in slab[2]])
    solid = hull(np.array(points))
    corners = solid.vertices[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(solid, curved=np.abs(normals).max(axis=1) < 0.999)


def shell(
    inner: Sequence[tuple[float, float]],
    outer: Sequence[tuple[float, float]],
    count: int = 12,
    center: tuple[float, float] = (0.0, 0.0),
) -> list[Solid]:
    """Return the convex wedges of a hollow solid of revolution: a wall between two profiles of equal length.

    `inner` and `outer` are (radius, z) pairs [m] from bottom to top; every pair of consecutive rings gives `count`
    wedges. The wall is open above and below.
    """
    wedges = []
    angle = 2 * np.pi * np.arange(count + 1) / count
    for low in range(len(inner) - 1):
        for k in range(count):
            points = [
                (center[0] + r * np.cos(a), center[1] + r * np.sin(a), z)
                for (r, z) in (inner[low], inner[low + 1], outer[low], outer[low + 1])
                for a in (angle[k], angle[k + 1])
            ]
            wedges.append(hull(np.array(points), curved=True))
    return wedges


def mass_properties(solids: Sequence[Solid], densities: Sequence[float]) -> MassProperties:
    """Return mass, centre and inertia of convex solids of the given densities [kg/m^3]; overlaps count twice.

    Exact: sum over the tetrahedra that each triangle spans with the origin. Raises ValueError without volume.
    """
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    canonical = (np.ones((3, 3)) + np.eye(3)) / 120.0
    for solid, density in zip(solids, densities, strict=True):
        corners = solid.vertices[solid.faces]
        determinant = np.linalg.det(corners)
        mass += density * determinant.sum() / 6.0
        first += density * np.einsum("f,fij->j", determinant, corners) / 24.0
        second += density * np.einsum("f,fai,ab,fbj->ij", determinant, corners, canonical, corners)
    if not mass > 0:
        raise ValueError("solids have no volume")
    center = first / mass
    covariance = second - mass * np.outer(center, center)
    return MassProperties(mass, center, np.trace(covariance) * np.eye(3) - covariance)


def volume(solid: Solid) -> float:
    """Return the volume [m^3]."""
    return float(np.linalg.det(solid.vertices[solid.faces]).sum() / 6.0)


def contains(solid: Solid, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Return (N,) bool: which points (N, 3) lie inside the solid, at least `margin` [m] below its faces."""
    corners = solid.vertices[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals = normals[length > 1e-14] / length[length > 1e-14, None]
    anchors = corners[length > 1e-14, 0]
    height = points @ normals.T - np.einsum("fi,fi->f", anchors, normals)
    return (height < -margin).all(axis=1)

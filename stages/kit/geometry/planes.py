"""Planes in point clouds: RANSAC with normals, iterative extraction, the rectangle that inliers cover."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.geometry.boxes import minimum_rectangle, polygon_area

UPWARD = 0.9
"""A normal (or the z axis of a frame) whose z is above this points up [-]."""
SCREENING_POINTS = 2000
"""Hypotheses are scored on this many points first; only the best few are scored on all (LIBRARIES 3d)."""
FINALISTS = 5
"""Best hypotheses of the screening that are scored on all points; by eye."""
REFITS = 2
"""Refits of the best plane to its inliers; by eye."""
BATCH = 64
"""Planes that are scored at a time, which bounds the memory."""


@dataclass(frozen=True)
class PlaneFit:
    """A plane n.v + d = 0 with unit normal, and the points that lie on it."""

    normal: np.ndarray
    """(3,)."""
    offset: float
    inliers: np.ndarray
    """(K,) indices into the points that were given, ascending."""


def plane_distances(points: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """Return signed distances (N,) [m] of points (N, 3) from the plane normal (3,), offset."""
    return points @ np.asarray(normal) + offset


def fit_plane(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return (normal (3,), offset) of the least-squares plane of points (N, 3), N >= 3. The sign is arbitrary."""
    center = points.mean(axis=0)
    centred = points - center
    normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    return normal, -float(normal @ center)


def plane_height(plane: SurfacePlane, at: np.ndarray) -> float:
    """Return the height z [m] of a plane that is not vertical, above the ground point `at` (2,).

    For a horizontal plane this is -d (equation 2.1); a_th admits slopes up to 26 degrees, for which -d would be the
    height at the world's origin instead of under the object.
    """
    nx, ny, nz = plane.normal
    return -(plane.offset + nx * float(at[0]) + ny * float(at[1])) / nz


def moved_planes(
    planes: Iterable[SurfacePlane], rotation: np.ndarray, translation: np.ndarray, scale: float = 1.0
) -> tuple[SurfacePlane, ...]:
    """Return planes where rotation (3, 3), translation (3,) [m] and scale put them: p -> R (s p) + t. A frame that
    stays upright keeps what is level; in another, what looks up is."""
    upright, placed = bool(rotation[2, 2] > UPWARD), []
    for plane in planes:
        normal = rotation @ np.asarray(plane.normal)
        points = scale * np.array([plane.center, *plane.corners]) @ rotation.T + translation
        placed.append(
            plane.model_copy(
                update={
                    "normal": as_vector(normal),
                    "offset": scale * plane.offset - float(normal @ translation),
                    "area": plane.area * scale**2,
                    "center": as_vector(points[0]),
                    "corners": tuple(as_vector(corner) for corner in points[1:]),
                    "horizontal": plane.horizontal if upright else bool(normal[2] >= UPWARD),
                }
            )
        )
    return tuple(placed)


def level_plane(outline: np.ndarray, height: float, *, hidden: bool) -> SurfacePlane:
    """Return a horizontal plane at `height` [m] over a convex ground polygon (K, 2), K >= 3."""
    corners = np.column_stack([outline, np.full(len(outline), height)])
    return SurfacePlane(
        normal=(0.0, 0.0, 1.0),
        offset=-float(height),
        area=polygon_area(outline),
        center=as_vector(corners.mean(axis=0)),
        corners=tuple(as_vector(corner) for corner in corners) if len(corners) == 4 else (),
        horizontal=True,
        hidden=hidden,
    )


def ransac_plane(
    points: np.ndarray,
    *,
    distance_threshold: float,
    iterations: int = 1000,
    random: np.random.Generator,
    normals: np.ndarray | None = None,
    normal_weight: float = 0.0,
    direction: np.ndarray | None = None,
    maximum_angle: float | None = None,
) -> PlaneFit | None:
    """Return the plane with most inliers among points (N, 3) [m], or None when no hypothesis is possible.

    A point is an inlier when (1 - w) * distance + w * angle <= `distance_threshold`, with w = `normal_weight` and
    the angle [rad] between the point's and the plane's normal (the rule of PCL's normal-plane model, which Han 2024
    uses; w = 0 leaves plain distances). Unlike PCL the angle is signed when `normals` (N, 3) are given, so the two
    faces of a thin board do not melt into one plane. `direction` (3,) and `maximum_angle` [rad] admit only planes
    whose normal (either sign) is that close to the direction.

    Every hypothesis is screened on a subset, the best few are scored on all points, the winner is refitted by
    principal components (preemptive scoring, LIBRARIES 3d). The normal points to the side of the inliers' normals,
    else along `direction`, else to +z. Raises ValueError on arrays of the wrong shape.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must be (N, 3), not {points.shape}")
    if normals is not None:
        normals = np.asarray(normals, dtype=float)
        if normals.shape != points.shape:
            raise ValueError(f"normals {normals.shape} do not match points {points.shape}")
    if len(points) < 3:
        return None
    weight = normal_weight if normals is not None else 0.0
    candidates = _hypotheses(points, normals, iterations, random)
    if direction is not None and maximum_angle is not None:
        unit = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
        candidates = candidates[np.abs(candidates[:, :3] @ unit) >= math.cos(maximum_angle)]
    if len(candidates) == 0:
        return None

    subset = slice(None) if len(points) <= SCREENING_POINTS else random.permutation(len(points))[:SCREENING_POINTS]
    screened = _count_inliers(
        candidates, points[subset], None if normals is None else normals[subset], weight, distance_threshold
    )
    finalists = candidates[np.argsort(-screened, kind="stable")[:FINALISTS]]
    counts = _count_inliers(finalists, points, normals, weight, distance_threshold)
    best = finalists[int(np.argmax(counts))]
    inliers = np.flatnonzero(_inlier_mask(best, points, normals, weight, distance_threshold))

    for _ in range(REFITS):
        if len(inliers) < 3:
            break
        normal, offset = fit_plane(points[inliers])
        if normal @ best[:3] < 0:
            normal, offset = -normal, -offset
        refined = np.array([*normal, offset])
        if direction is not None and maximum_angle is not None and abs(normal @ unit) < math.cos(maximum_angle):
            break
        new_inliers = np.flatnonzero(_inlier_mask(refined, points, normals, weight, distance_threshold))
        if len(new_inliers) < len(inliers):
            break
        best, inliers = refined, new_inliers
    if len(inliers) == 0:
        return None
    return _oriented(best, inliers, normals, direction)


def ransac_planes(
    points: np.ndarray,
    normals: np.ndarray | None = None,
    *,
    distance_threshold: float,
    iterations: int = 200,
    random: np.random.Generator,
    normal_weight: float = 0.1,
    minimum_share: float = 0.1,
    maximum_planes: int = 20,
) -> list[PlaneFit]:
    """Return planes of points (N, 3) [m] by RANSAC and removal of the inliers, largest first.

    Han 2024, section 2.2.2 with the constants of the released code (PROTOCOLS section 3): 200 iterations, normal
    weight 0.1, a plane is kept while it has more than `minimum_share` of all points, and the search stops when
    fewer than that remain. Inlier indices refer to `points`.
    """
    points = np.asarray(points, dtype=float)
    remaining = np.arange(len(points))
    least = max(3.0, minimum_share * len(points))
    planes: list[PlaneFit] = []
    while len(remaining) >= least and len(planes) < maximum_planes:
        plane = ransac_plane(
            points[remaining],
            distance_threshold=distance_threshold,
            iterations=iterations,
            random=random,
            normals=None if normals is None else normals[remaining],
            normal_weight=normal_weight,
        )
        if plane is None or len(plane.inliers) <= minimum_share * len(points) or len(plane.inliers) < 3:
            break
        planes.append(PlaneFit(plane.normal, plane.offset, remaining[plane.inliers]))
        keep = np.ones(len(remaining), dtype=bool)
        keep[plane.inliers] = False
        remaining = remaining[keep]
    return sorted(planes, key=lambda plane: -len(plane.inliers))


def plane_axes(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors (3,) that span the plane, right-handed with `normal`; horizontal planes get x and y."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = helper - (helper @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


def plane_rectangle(points_inliers: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, float]:
    """Return (corners (4, 3), area [m^2]) of the least-area rectangle in the plane around its inliers (K, 3).

    The rectangle lies at the inliers' mean height along `normal` (3,); corners go counter-clockwise seen from the
    tip of the normal. Raises ValueError without points.
    """
    points = np.asarray(points_inliers, dtype=float).reshape(-1, 3)
    if len(points) == 0:
        raise ValueError("no inliers")
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    first, second = plane_axes(normal)
    flat = np.stack([points @ first, points @ second], axis=1)
    center, size, yaw = minimum_rectangle(flat)
    half = size / 2
    local = np.array([[-half[0], -half[1]], [half[0], -half[1]], [half[0], half[1]], [-half[0], half[1]]])
    rotation = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    flat_corners = local @ rotation.T + center
    height = float(np.mean(points @ normal))
    corners = flat_corners[:, :1] * first + flat_corners[:, 1:] * second + height * normal
    return corners, float(size[0] * size[1])


def _hypotheses(
    points: np.ndarray, normals: np.ndarray | None, iterations: int, random: np.random.Generator
) -> np.ndarray:
    """Return planes (K, 4) through random triples; with normals the sign follows the triple's own normals."""
    triples = random.integers(0, len(points), size=(iterations, 3))
    a, b, c = (points[triples[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    # Triples with a repeated or nearly collinear point say nothing about a plane.
    spread = np.maximum(np.linalg.norm(b - a, axis=1), np.linalg.norm(c - a, axis=1))
    good = length > 1e-6 * np.maximum(spread, 1e-12) ** 2
    normal = normal[good] / length[good, None]
    if normals is not None:
        votes = np.einsum("ij,ij->i", normals[triples[good]].sum(axis=1), normal)
        normal = np.where(votes[:, None] < 0, -normal, normal)
    offset = -np.einsum("ij,ij->i", normal, a[good])
    return np.concatenate([normal, offset[:, None]], axis=1)


def _residuals(planes: np.ndarray, points: np.ndarray, normals: np.ndarray | None, weight: float) -> np.ndarray:
    """Return residuals (K, N) of points under planes (K, 4)."""
    distance = np.abs(planes[:, :3] @ points.T + planes[:, 3:])
    if normals is None or weight == 0.0:
        return distance
    angle = np.arccos(np.clip(planes[:, :3] @ normals.T, -1.0, 1.0))
    return (1.0 - weight) * distance + weight * angle


def _inlier_mask(
    plane: np.ndarray, points: np.ndarray, normals: np.ndarray | None, weight: float, threshold: float
) -> np.ndarray:
    return _residuals(plane[None], points, normals, weight)[0] <= threshold


def _count_inliers(
    planes: np.ndarray, points: np.ndarray, normals: np.ndarray | None, weight: float, threshold: float
) -> np.ndarray:
    """Return the number of inliers (K,) of each plane (K, 4); in batches to bound memory."""
    counts = [
        np.count_nonzero(_residuals(planes[k : k + BATCH], points, normals, weight) <= threshold, axis=1)
        for k in range(0, len(planes), BATCH)
    ]
    return np.concatenate(counts)


def _oriented(
    plane: np.ndarray, inliers: np.ndarray, normals: np.ndarray | None, direction: np.ndarray | None
) -> PlaneFit:
    normal, offset = plane[:3], float(plane[3])
    if normals is not None:
        vote = float(normals[inliers].sum(axis=0) @ normal)
    elif direction is not None:
        vote = float(np.asarray(direction) @ normal)
    else:
        # The first component that is not 0, from z down, decides.
        vote = float(next((v for v in normal[::-1] if abs(v) > 1e-9), 1.0))
    if vote < 0:
        normal, offset = -normal, -offset
    return PlaneFit(normal, offset, inliers)

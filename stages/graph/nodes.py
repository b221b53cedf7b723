"""Scene entity nodes <o, c, M, B, Pi> while the graph is built (Han 2024, section 2.2.2, initialisation)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Box, SurfacePlane
from scenewright.stages.kit.geometry.boxes import bottom, convex_hull, polygon_area, top
from scenewright.stages.kit.geometry.planes import PlaneFit, level_plane, plane_rectangle, ransac_plane, ransac_planes
from scenewright.stages.kit.geometry.point_clouds import clusters

GRAVITY = np.array([0.0, 0.0, -1.0])
"""Direction of gravity; z is up in every map."""
CONTAINER_CLASSES = frozenset(
    {"shelf", "bin", "bowl", "box", "sink", "vase", "cup", "backpack", "cabinet", "wall_cabinet"}
)
"""Rigid things that things are put into; articulated classes contain as well."""
THINNEST_DISTANCE = 0.005
"""RANSAC distance never falls below half a centimetre: surfaces of a fused map are not more exact than that."""
SAME_HEIGHT = 0.02
"""Horizontal patches of one entity nearer than this in height are one plane."""
MAXIMUM_TILT = math.radians(10.0)
"""Largest tilt of a supporting plane in `ours`, although a_th lets 25 degrees pass [rad]."""


@dataclass(frozen=True)
class Patch:
    """A surface plane, the points on it, and (where horizontal) the hull of their ground projection."""

    plane: SurfacePlane
    points: np.ndarray
    """(K, 3) [m]."""
    hull: np.ndarray
    """(M, 2) convex, counter-clockwise; empty when the plane is not horizontal."""


@dataclass(frozen=True)
class Entity:
    """A node of the parse tree in the making."""

    name: str
    instance: int
    class_name: str
    node_type: Literal["layout", "rigid", "articulated"]
    movable: bool
    mesh: str | None
    confidence: float
    points: np.ndarray
    """(N, 3) on the thinning grid, strays removed [m]."""
    box: Box
    patches: tuple[Patch, ...]

    @property
    def bottom(self) -> float:
        """Height of the box's bottom face [m]."""
        return bottom(self.box)

    @property
    def top(self) -> float:
        """Height of the box's top face [m]."""
        return top(self.box)

    @property
    def is_container(self) -> bool:
        """Whether things stand in it rather than on it."""
        return self.node_type == "articulated" or self.class_name in CONTAINER_CLASSES

    @property
    def supporting(self) -> tuple[int, ...]:
        """Indices of the horizontal patches."""
        return tuple(k for k, patch in enumerate(self.patches) if patch.plane.horizontal)

    def with_patch(self, patch: Patch) -> Entity:
        """Return the entity with one more plane (a hidden one that was registered)."""
        return replace(self, patches=(*self.patches, patch))


def is_horizontal(normal: np.ndarray, threshold: float) -> bool:
    """Equation 2.1, first line: n . g <= a_th, for a unit normal (3,)."""
    return float(np.asarray(normal) @ GRAVITY) <= threshold


@dataclass(frozen=True)
class SmallSupports:
    """Supporting planes that the share rule leaves over, and that things stand on all the same."""

    minimum_area: float
    """[m^2]"""
    split_distance: float | None = None
    """Horizontal planes fall into clusters this far apart [m]: a wall entity goes around the room; ledges on opposite
    sides are not one surface."""


@dataclass(frozen=True)
class PlaneSearch:
    """Constants of the search for surface planes."""

    distance: float
    """RANSAC inlier distance [m]."""
    iterations: int
    normal_weight: float
    plane_share: float
    horizontal_threshold: float
    """a_th."""
    spacing: float
    """Grid that the points lie on [m]."""
    small: SmallSupports | None = None
    """None leaves the thesis's planes alone."""


def surface_planes(
    points: np.ndarray, normals: np.ndarray, search: PlaneSearch, random: np.random.Generator
) -> tuple[Patch, ...]:
    """Return the surface planes Pi of points (N, 3) with outward unit normals (N, 3) (Han 2024, section 2.2.2)."""
    fits = ransac_planes(
        points,
        normals,
        distance_threshold=search.distance,
        iterations=search.iterations,
        random=random,
        normal_weight=search.normal_weight,
        minimum_share=search.plane_share,
    )
    if search.small is not None:
        fits = with_small_supports(points, normals, fits, search, search.small, random)
    return tuple(patch_from_fit(points, fit, search.horizontal_threshold) for fit in fits)


def with_small_supports(
    points: np.ndarray,
    normals: np.ndarray,
    fits: list[PlaneFit],
    search: PlaneSearch,
    small: SmallSupports,
    random: np.random.Generator,
) -> list[PlaneFit]:
    """Return the planes of points (N, 3) with small supporting ones beside them, horizontal ones level, at different
    heights and (`split_distance`) in one piece each; slanted ones go."""
    threshold = search.horizontal_threshold
    fits = [fit for fit in fits if not is_slanted(fit.normal, threshold)]
    free = np.ones(len(points), dtype=bool)
    for fit in fits:
        free[fit.inliers] = False
    unexplained = np.flatnonzero(free)
    least = max(5, math.ceil(small.minimum_area / search.spacing**2))
    supports = small_support_planes(
        points[unexplained], normals[unexplained], search.distance, threshold, least, random
    )
    fits += [PlaneFit(fit.normal, fit.offset, unexplained[fit.inliers]) for fit in supports]
    fits = level_planes(points, fits, threshold, least)
    fits = merge_levels(points, fits, threshold)
    if small.split_distance is not None:
        fits = split_levels(points, fits, threshold, small.split_distance, least)
    return fits


def is_slanted(normal: np.ndarray, horizontal_threshold: float) -> bool:
    """Whether a plane passes a_th but tilts by more than MAXIMUM_TILT: in noisy insides of furniture RANSAC lays such
    planes through the edge of one board and the back of another, and nothing would rest on one."""
    return is_horizontal(normal, horizontal_threshold) and float(-normal @ GRAVITY) < math.cos(MAXIMUM_TILT)


def small_support_planes(
    points: np.ndarray,
    normals: np.ndarray,
    distance: float,
    horizontal_threshold: float,
    minimum_count: int,
    random: np.random.Generator,
) -> list[PlaneFit]:
    """Return horizontal planes among the points (N, 3) that the share rule left over.

    The thesis keeps planes with more than a tenth of an entity's points. The boards of a shelf or of an open fridge
    have fewer, and yet they are what things stand on. Only points whose own normal points up are searched.
    """
    upward = np.flatnonzero(normals @ GRAVITY <= horizontal_threshold)
    planes: list[PlaneFit] = []
    while len(upward) >= minimum_count:
        fit = ransac_plane(
            points[upward],
            distance_threshold=min(distance, SAME_HEIGHT),
            iterations=100,
            random=random,
            normals=normals[upward],
            normal_weight=0.0,
            direction=-GRAVITY,
            maximum_angle=min(math.acos(-horizontal_threshold), MAXIMUM_TILT),
        )
        if fit is None or len(fit.inliers) < minimum_count:
            break
        planes.append(PlaneFit(fit.normal, fit.offset, upward[fit.inliers]))
        upward = np.delete(upward, fit.inliers)
    return planes


def level_planes(
    points: np.ndarray, fits: list[PlaneFit], horizontal_threshold: float, minimum_count: int
) -> list[PlaneFit]:
    """Return the planes with the horizontal ones made level, at the height around which most of their inliers lie.

    A board of a fridge that only its back edge shows fits a plane that leans by some degrees as well as a level one,
    and half a metre further in front, under the bottle, such a plane is centimetres too low. Inliers farther than
    SAME_HEIGHT from the level belong to something else; a plane that keeps fewer than `minimum_count` is none.
    """
    result = []
    for fit in fits:
        if not is_horizontal(fit.normal, horizontal_threshold):
            result.append(fit)
            continue
        heights = points[fit.inliers, 2]
        ordered = np.sort(heights)
        reach = np.searchsorted(ordered, ordered + SAME_HEIGHT, side="right") - np.arange(len(ordered))
        first = int(np.argmax(reach))
        height = float(np.median(ordered[first : first + reach[first]]))
        at_height = fit.inliers[np.abs(heights - height) <= SAME_HEIGHT]
        if len(at_height) >= minimum_count:
            result.append(PlaneFit(np.array([0.0, 0.0, 1.0]), -height, at_height))
    return result


def merge_levels(points: np.ndarray, fits: list[PlaneFit], horizontal_threshold: float) -> list[PlaneFit]:
    """Merge horizontal planes at the same height (within 2 cm) into the largest of them.

    One table top that noise bent falls into two planes; the released code merges such planes too.
    """
    result: list[PlaneFit] = []
    for fit in fits:
        height = float(points[fit.inliers, 2].mean())
        if is_horizontal(fit.normal, horizontal_threshold):
            for k, larger in enumerate(result):
                level = abs(float(points[larger.inliers, 2].mean()) - height) < SAME_HEIGHT
                if level and is_horizontal(larger.normal, horizontal_threshold):
                    inliers = np.sort(np.concatenate([larger.inliers, fit.inliers]))
                    result[k] = PlaneFit(larger.normal, larger.offset, inliers)
                    break
            else:
                result.append(fit)
        else:
            result.append(fit)
    return result


def split_levels(
    points: np.ndarray, fits: list[PlaneFit], horizontal_threshold: float, distance: float, minimum_count: int
) -> list[PlaneFit]:
    """Split horizontal planes into clusters of inliers `distance` [m] apart; smaller ones than `minimum_count` go."""
    result: list[PlaneFit] = []
    for fit in fits:
        if not is_horizontal(fit.normal, horizontal_threshold):
            result.append(fit)
            continue
        label = clusters(points[fit.inliers], distance)
        for k in range(int(label.max()) + 1):
            members = fit.inliers[label == k]
            if len(members) >= minimum_count:
                result.append(PlaneFit(fit.normal, fit.offset, members))
    return result


def patch_from_fit(points: np.ndarray, fit: PlaneFit, horizontal_threshold: float) -> Patch:
    """Return the patch of a fitted plane: centre, rectangle and hull of its inliers."""
    inliers = points[fit.inliers]
    normal = fit.normal / np.linalg.norm(fit.normal)
    center = inliers.mean(axis=0)
    corners, area = plane_rectangle(inliers, normal)
    horizontal = is_horizontal(normal, horizontal_threshold)
    hull = convex_hull(inliers[:, :2]) if horizontal else np.zeros((0, 2))
    plane = SurfacePlane(
        normal=as_vector(normal),
        offset=float(fit.offset),
        area=polygon_area(hull) if horizontal else area,
        center=as_vector(center),
        corners=tuple(as_vector(corner) for corner in corners),
        horizontal=horizontal,
    )
    return Patch(plane, inliers, hull)


def level_patch(outline: np.ndarray, height: float, *, hidden: bool) -> Patch:
    """Return a horizontal plane at `height` [m] over a convex ground polygon (K, 2), K >= 3."""
    corners = np.column_stack([outline, np.full(len(outline), height)])
    return Patch(level_plane(outline, height, hidden=hidden), corners, outline)

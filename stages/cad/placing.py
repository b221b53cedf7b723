"""From matches to placements, and how placements relate to supports and walls (Han 2024, sections 2.4.3 and 2.4.4)."""

from __future__ import annotations

import math

import numpy as np
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.scene_parts import Box, SurfacePlane
from scenewright.stages.cad.alignment import Alignment
from scenewright.stages.cad.matching import CUBE_ROTATIONS, Match
from scenewright.stages.cad.model_surfaces import ModelSurface, to_world
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.geometry.boxes import (
    box_corners,
    clip_polygon,
    footprint,
    gravity_aligned_box,
    polygon_area,
)
from scenewright.stages.kit.geometry.planes import UPWARD, moved_planes
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

COVER_SHARE = 0.1
"""A surface above a child limits its height when it covers this share of the child's footprint."""
WALL_NEAR = 0.15
"""A wall this near to an object is right behind it [m]."""
HEIGHT_SLACK = 0.03
"""A child may be this much too high for the room above a surface: its height is an estimate [m]."""


def placement_of(match: Match, alignment: Alignment) -> Placement:
    """Return the placement of an aligned candidate; its alignment error is not known yet."""
    rotation = transform_from_yaw(alignment.yaw, np.zeros(3))[:3, :3] @ CUBE_ROTATIONS[match.orientation]
    translation = alignment.position - alignment.scale * rotation @ match.shape.center
    return Placement(match.shape, alignment.scale, rotation, translation, match.error, math.inf, math.inf)


def is_upright(placement: Placement) -> bool:
    """Whether the model's z axis points up."""
    return bool(placement.rotation[2, 2] > UPWARD)


def placed_yaw(placement: Placement) -> float:
    """Return the turn of the model about world z [rad]; of its x or y axis when it lies on its side."""
    axis = placement.rotation[:, 0] if abs(placement.rotation[2, 0]) < UPWARD else placement.rotation[:, 1]
    return math.atan2(axis[1], axis[0])


def placed_box(placement: Placement, surface: ModelSurface) -> Box:
    """Return the gravity-aligned box of a placed model, sides along the model's own axes."""
    points = to_world(placement, surface.hull_points(placement.shape.joints))
    yaw = placed_yaw(placement)
    yaw = (yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4
    cosine, sine = math.cos(yaw), math.sin(yaw)
    local = np.column_stack([points[:, :2] @ np.array([[cosine, -sine], [sine, cosine]]), points[:, 2]])
    low, high = local.min(axis=0), local.max(axis=0)
    middle = (low + high) / 2
    ground = np.array([[cosine, -sine], [sine, cosine]]) @ middle[:2]
    return gravity_aligned_box((*ground, middle[2]), high - low, yaw)


def placed_planes(placement: Placement) -> tuple[SurfacePlane, ...]:
    """Return the model's surface planes in the world."""
    return moved_planes(placement.shape.surfaces, placement.rotation, placement.translation, placement.scale)


def size_misfit(frame_size: np.ndarray, placement: Placement) -> float:
    """Return the root mean square difference [m] of the extents (3,) of the observed box and the placed model's."""
    turned = np.abs(np.round(transform_from_yaw(-placed_yaw(placement), np.zeros(3))[:3, :3] @ placement.rotation))
    mine = placement.scale * turned @ placement.shape.size
    straight, swapped = mine - frame_size, mine[[1, 0, 2]] - frame_size
    return float(np.sqrt(min(np.mean(straight**2), np.mean(swapped**2))))


def surface_outline(plane: SurfacePlane) -> np.ndarray:
    """Return the ground outline (4, 2) of a plane's rectangle, counter-clockwise; (0, 2) without corners."""
    if len(plane.corners) < 3:
        return np.zeros((0, 2))
    outline = np.asarray(plane.corners)[:, :2]
    return outline if polygon_area(outline) >= 0 else outline[::-1]


def surface_share(plane: SurfacePlane, child: Box) -> float:
    """Equation 2.2 on a CAD surface: the share of the child's footprint that lies over the plane's rectangle."""
    outline, ground = surface_outline(plane), footprint(child)
    area = polygon_area(ground)
    if len(outline) < 3 or area <= 0.0:
        return 0.0
    return float(max(0.0, polygon_area(clip_polygon(ground, outline))) / area)


def free_height(planes: tuple[SurfacePlane, ...], surface: int, child: Box) -> float:
    """Return the room [m] above one surface under the lowest plane that looks down on the child's footprint."""
    height = planes[surface].center[2]
    above = [
        plane.center[2] - height
        for plane in planes
        if plane.normal[2] <= -UPWARD and plane.center[2] > height + 1e-6 and surface_share(plane, child) > COVER_SHARE
    ]
    return min(above, default=math.inf)


def supporting_surface(
    planes: tuple[SurfacePlane, ...], child: Box, height: float, *, area_threshold: float, tolerance: float
) -> int | None:
    """Return the index of the CAD surface that a child goes on, or None when there is none.

    The nearest in height to where the child was seen to stand (`height` [m]), within `tolerance`, among horizontal
    planes that carry enough of its footprint (2.2) and leave room for it above.
    """
    fitting = []
    for k, plane in enumerate(planes):
        difference = abs(plane.center[2] - height)
        if not plane.horizontal or difference > tolerance:
            continue
        share = surface_share(plane, child)
        if share < area_threshold or free_height(planes, k, child) + HEIGHT_SLACK < child.size[2]:
            continue
        fitting.append((round(difference, 6), -share, k))
    return min(fitting)[2] if fitting else None


def facing_wall(placement: Placement, box: Box, walls: list[GraphNode]) -> float:
    """Return how much the model's front (-y) looks at a wall right behind or before it: 0 away from it, 1 into it.

    0 as well when no wall is nearer than `WALL_NEAR` to the object's box. (The released code prefers fronts that face
    away from the nearest wall; a closed cabinet or microwave looks much the same from behind.)
    """
    front = -placement.rotation[:, 1]
    corners, center = box_corners(box), np.asarray(box.center)
    nearest, result = WALL_NEAR, 0.0
    for wall in walls:
        for plane in wall.planes:
            normal = np.asarray(plane.normal)
            if abs(normal[2]) > 0.5 or float(center @ normal) + plane.offset <= 0.0 or not within(plane, center):
                continue
            gap = abs(float((corners @ normal + plane.offset).min()))
            if gap < nearest:
                nearest, result = gap, 0.5 * (1.0 - float(front @ normal))
    return result


def within(plane: SurfacePlane, point: np.ndarray) -> bool:
    """Whether the projection of a point (3,) lies in the rectangle of a plane."""
    if len(plane.corners) != 4:
        return False
    corners = np.asarray(plane.corners)
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    u = float((point - corners[0]) @ first) / max(float(first @ first), 1e-12)
    v = float((point - corners[0]) @ second) / max(float(second @ second), 1e-12)
    return 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0


def wall_depths(points: np.ndarray, observed: np.ndarray, walls: list[GraphNode]) -> list[tuple[float, np.ndarray]]:
    """Return how deep [m] points (N, 3) of a placed model reach into each wall that they reach into, and the normal
    (3,) that leads out of it.

    Only walls in front of which the object was seen: its centre `observed` (3,) lies on the side of the plane's normal
    and within its rectangle.
    """
    depths = []
    for wall in walls:
        for plane in wall.planes:
            if abs(plane.normal[2]) > 0.5 or len(plane.corners) != 4:
                continue
            normal, corners = np.asarray(plane.normal), np.asarray(plane.corners)
            if float(observed @ normal) + plane.offset <= 0.0:
                continue
            first, second = corners[1] - corners[0], corners[3] - corners[0]
            u = (points - corners[0]) @ first / max(float(first @ first), 1e-12)
            v = (points - corners[0]) @ second / max(float(second @ second), 1e-12)
            behind = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
            depth = float(-(points[behind] @ normal + plane.offset).min()) if behind.any() else 0.0
            if depth > 0.0:
                depths.append((depth, normal))
    return depths

"""Objects that hang on walls: distance from an object to a wall's mesh or the plane behind it."""

from __future__ import annotations

import math

import numpy as np
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.support import Candidate
from scipy.spatial import cKDTree

NEAREST_SHARE = 0.02
"""The distance is that of the nearest 2 % of the object's points: one leaked vertex is no contact."""


def wall_distance(child: Entity, wall: Entity, tree: cKDTree | None = None, limit: float = math.inf) -> float:
    """Return the distance [m] from an object to a wall (or another upright layout entity); inf beyond `limit`.

    The thesis falls back to "the nearest wall by mesh distance". The wall is hidden just where the object hangs,
    so the distance to the plane behind the object counts too, where the object lies within the plane's rectangle.
    """
    tree = cKDTree(wall.points) if tree is None else tree
    mesh_distance, _ = tree.query(child.points, distance_upper_bound=limit)
    # The order statistic, as interpolation fails between infinite distances.
    nearest = np.sort(mesh_distance)[int(NEAREST_SHARE * (len(mesh_distance) - 1))]
    distances = [float(nearest)]
    for patch in wall.patches:
        plane = patch.plane
        if abs(plane.normal[2]) < 0.5 and within_rectangle(np.asarray(child.box.center), plane):
            signed = child.points @ np.asarray(plane.normal) + plane.offset
            distances.append(abs(float(np.quantile(signed, NEAREST_SHARE))))
    return min(distances)


def within_rectangle(point: np.ndarray, plane: SurfacePlane) -> bool:
    """Whether the projection of a point (3,) lies in the rectangle of the plane's inliers."""
    if len(plane.corners) != 4:
        return False
    corners = np.asarray(plane.corners)
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    offset = np.asarray(point) - corners[0]
    u, v = offset @ first / max(first @ first, 1e-12), offset @ second / max(second @ second, 1e-12)
    return bool(0.0 <= u <= 1.0 and 0.0 <= v <= 1.0)


def search_trees(walls: list[Entity]) -> dict[str, cKDTree]:
    """Return a search tree over the points of every wall, by name."""
    return {wall.name: cKDTree(wall.points) for wall in walls}


def wall_candidate(child: Entity, walls: list[Entity], limit: float, trees: dict[str, cKDTree]) -> Candidate | None:
    """Return the relation `carries_on_wall` of the nearest wall within `limit` [m], or None.

    The confidence falls linearly from 1 at contact to 0.5 at the limit. (The released code takes min(distance, 0) and
    so gives every wall the same score, and the first one every object.)
    """
    measured = [(wall_distance(child, wall, trees[wall.name], 2 * limit), wall.instance, wall) for wall in walls]
    in_reach = [entry for entry in measured if entry[0] <= limit]
    if not in_reach:
        return None
    distance, _, wall = min(in_reach, key=lambda entry: entry[:2])
    confidence = 1.0 - 0.5 * distance / limit if limit > 0 else 1.0
    return Candidate(child.name, wall.name, confidence, "carries_on_wall", distance, 0.0, child.bottom, None)

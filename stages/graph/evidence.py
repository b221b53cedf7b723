"""What speaks for a relation: the plane, the gap, the overlap, and where the two meet (docs/SCENES.md)."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import Vector3, as_vector
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.stages.graph.balance import LEAST_HEIGHT
from scenewright.stages.graph.nodes import Entity, Patch
from scenewright.stages.graph.support import Candidate
from scenewright.stages.kit.geometry.boxes import (
    bottom,
    box_corners,
    box_volume,
    boxes_overlap_volume,
    clip_polygon,
    convex_hull,
    footprint,
    polygon_area,
    top,
)
from scenewright.stages.kit.geometry.planes import plane_height
from scipy.spatial import cKDTree

UPRIGHT_NORMAL = 0.5
"""Planes whose normal's z is below this are sides, those above surfaces [-]."""
CONTACT_DEPTH = 0.02
"""Surfaces within this distance of the least one are where two things meet [m]."""
PLANE_DISTANCE = 0.03
"""A contact belongs to a plane that passes this close by [m]."""


def relation_of(candidate: Candidate, entities: dict[str, Entity]) -> Relation:
    """Return the edge of a chosen tree relation with its evidence. `entities`: nodes by name, planes registered."""
    relation = Relation(
        source=candidate.parent,
        target=candidate.child,
        relation=candidate.relation,
        confidence=float(min(1.0, max(0.0, candidate.score))),
    )
    child, parent = entities[candidate.child], entities[candidate.parent]
    if candidate.relation == "carries_on_wall":
        return _on_wall(relation, candidate, child, parent)
    if candidate.relation == "hangs_from":
        return _from_above(relation, candidate, child, parent)
    if candidate.patch is None:
        return relation
    measured: dict[str, object] = {
        "plane": candidate.patch,
        "gap": float(candidate.gap),
        "overlap": float(candidate.overlap),
        "contact": on_surface(child.box, parent.patches[candidate.patch].hull, candidate.height),
    }
    if candidate.relation == "contains":
        measured["inside"] = share_inside(child.box, parent.box)
    return relation.model_copy(update=measured)


def on_surface(child: Box, hull: np.ndarray, height: float) -> Vector3 | None:
    """Return the middle of what a footprint shares with a convex ground polygon (K, 2), at `height` [m]; None when they
    do not meet."""
    if len(hull) < 3:
        return None
    middle = polygon_middle(clip_polygon(hull, footprint(child)))
    return None if middle is None else as_vector(np.array([*middle, height]))


def polygon_middle(polygon: np.ndarray) -> np.ndarray | None:
    """Return the centroid (2,) of a convex polygon (K, 2); None when it has no area."""
    if len(polygon) < 3 or abs(polygon_area(polygon)) < 1e-9:
        return None
    x, y = (polygon - polygon[0]).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    shift = np.array([((x + np.roll(x, -1)) * cross).sum(), ((y + np.roll(y, -1)) * cross).sum()])
    return polygon[0] + shift / (3.0 * cross.sum())


def share_inside(child: Box, parent: Box) -> float:
    """Return the share of a box's volume that lies within another one; 0 for a box without volume."""
    volume = box_volume(child)
    return float(min(1.0, boxes_overlap_volume(child, parent) / volume)) if volume > 0.0 else 0.0


def rectangle_share(child: Box, patch: Patch) -> tuple[float, np.ndarray]:
    """Return how much of a box's shadow on an upright plane lies within the plane's rectangle, and the middle (3,) of
    that part. The shadow is the bounding rectangle of the box's corners along the plane's axes."""
    corners = np.asarray(patch.plane.corners)
    axes = np.stack([corners[1] - corners[0], corners[3] - corners[0]])
    length = np.maximum(np.linalg.norm(axes, axis=1), 1e-9)
    axes /= length[:, None]
    shadow = (box_corners(child) - corners[0]) @ axes.T
    low, high = shadow.min(axis=0), shadow.max(axis=0)
    first, last = np.clip(low, 0.0, length), np.clip(high, 0.0, length)
    share = float(np.prod(last - first) / max(float(np.prod(high - low)), 1e-12))
    return share, corners[0] + 0.5 * (first + last) @ axes


def _on_wall(relation: Relation, candidate: Candidate, child: Entity, wall: Entity) -> Relation:
    """The plane of the wall behind the child: the nearest among those that it hangs before."""
    best: tuple[float, int, float, np.ndarray] | None = None
    for k, patch in enumerate(wall.patches):
        plane = patch.plane
        if abs(plane.normal[2]) >= UPRIGHT_NORMAL or len(plane.corners) != 4:
            continue
        distance = float(np.abs(child.points @ np.asarray(plane.normal) + plane.offset).min())
        share, middle = rectangle_share(child.box, patch)
        if share > 0.0 and (best is None or distance < best[0]):
            best = (distance, k, share, middle)
    measured: dict[str, object] = {"gap": float(candidate.gap)}
    if best is not None:
        measured |= {"plane": best[1], "overlap": best[2], "contact": as_vector(best[3])}
    return relation.model_copy(update=measured)


def _from_above(relation: Relation, candidate: Candidate, child: Entity, ceiling: Entity) -> Relation:
    """The ceiling's level plane nearest to the child's top; the contact lies over the uppermost points."""
    middle_of_child = np.asarray(child.box.center[:2])
    level = [
        (abs(plane_height(patch.plane, middle_of_child) - child.top), k)
        for k, patch in enumerate(ceiling.patches)
        if abs(patch.plane.normal[2]) >= UPRIGHT_NORMAL
    ]
    highest = child.points[child.points[:, 2] >= child.top - CONTACT_DEPTH, :2]
    middle = highest.mean(axis=0) if len(highest) else middle_of_child
    contact = np.array([*middle, child.top + candidate.gap])
    measured: dict[str, object] = {"gap": float(candidate.gap), "contact": as_vector(contact)}
    if level:
        k = min(level)[1]
        child_footprint = footprint(child.box)
        shared = clip_polygon(convex_hull(ceiling.patches[k].points[:, :2]), child_footprint)
        measured |= {
            "plane": k,
            "overlap": float(min(1.0, polygon_area(shared) / max(polygon_area(child_footprint), 1e-12))),
        }
    return relation.model_copy(update=measured)


def with_leaning_contact(relation: Relation, child: Entity, other: Entity) -> Relation:
    """Return a `leans_on` relation with where it touches: the point, its share of the height, the other's plane."""
    distance, nearest = cKDTree(other.points).query(child.points)
    high = child.points[:, 2] >= child.bottom + LEAST_HEIGHT * (child.top - child.bottom)
    if not high.any():
        return relation
    touching = high & (distance <= distance[high].min() + CONTACT_DEPTH)
    contact = other.points[nearest[touching]].mean(axis=0)
    height = max(child.top - child.bottom, 1e-9)
    return relation.model_copy(
        update={
            "plane": plane_at(other, contact),
            "overlap": float(np.clip((contact[2] - child.bottom) / height, 0.0, 1.0)),
            "contact": as_vector(contact),
        }
    )


def plane_at(entity: Entity, point: np.ndarray) -> int | None:
    """Return the index of the entity's plane nearest to a point (3,) of its surface; None beyond PLANE_DISTANCE."""
    reach = [
        (abs(float(np.asarray(patch.plane.normal) @ point) + patch.plane.offset), k)
        for k, patch in enumerate(entity.patches)
    ]
    return min(reach)[1] if reach and min(reach)[0] <= PLANE_DISTANCE else None


def shared_middle(first: Box, second: Box) -> Vector3 | None:
    """Return the middle of the volume that two gravity-aligned boxes share; None when they share none."""
    middle = polygon_middle(clip_polygon(footprint(first), footprint(second)))
    low, high = max(bottom(first), bottom(second)), min(top(first), top(second))
    return None if middle is None or low > high else as_vector(np.array([*middle, 0.5 * (low + high)]))


EVERY = 64
"""Every so many points one is looked up first."""


class Surfaces:
    """Search trees of the nodes' points, each built once, when it is first asked for."""

    def __init__(self) -> None:
        self._trees: dict[str, cKDTree] = {}

    def distance(self, first: Entity, second: Entity) -> float | None:
        """Return the least distance of the two point sets [m]; None when either has no points."""
        small, large = sorted((first, second), key=lambda entity: (len(entity.points), entity.name))
        if not len(small.points):
            return None
        if large.name not in self._trees:
            self._trees[large.name] = cKDTree(large.points)
        tree = self._trees[large.name]
        # Far points are slow to look up; a few give a bound that leaves out most of the others.
        bound = tree.query(small.points[::EVERY])[0].min()
        return float(min(bound, tree.query(small.points, distance_upper_bound=bound)[0].min()))

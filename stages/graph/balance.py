"""Whether an object can stand on what is under it, or must be held by something beside it (statics, not learning)."""

from __future__ import annotations

import numpy as np
import shapely
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.kit.geometry.boxes import convex_hull
from scenewright.stages.kit.geometry.planes import plane_height
from scipy.spatial import cKDTree

FOOT_HEIGHT = 0.03
"""Points within this height over the lowest one can touch the ground [m]."""
LOWEST_SHARE = 0.01
"""Share of the points that is noise below the object."""
CLEARANCE = 0.02
"""How far outside of its footing the middle of an object must lie before it counts as unbalanced [m]."""
CLEARANCE_SHARE = 0.1
"""The same in shares of its height: a board of 2 m that leans by less stands."""
TILTED_SHARE = 0.04
"""The same for a thing whose largest face is seen to lean: 0.04 is a panel that leans by 5 degrees."""
TILTED = (0.08, 0.8)
"""Upward part of the normal of a face that leans: 5 to 53 degrees off upright."""
TOUCH = 0.03
"""Largest distance between an object and what it leans on [m]."""
LEAST_HEIGHT = 0.3
"""Share of its height at or above which an object touches what it leans on."""
LEAST_TOUCHING = 5
"""A thing of fewer points is not judged, and no thing leans on what it touches with fewer; by eye."""
FOOTING_GAP = 0.1
"""Height of an object's bottom over all planes of its carrier from which on its feet are missing [m]."""


def footing(points: np.ndarray) -> np.ndarray:
    """Return the hull (K, 2) of the ground projection of the points (N, 3) [m] that can touch what carries them."""
    lowest = np.quantile(points[:, 2], LOWEST_SHARE)
    return convex_hull(points[points[:, 2] <= lowest + FOOT_HEIGHT, :2])


def overhang(points: np.ndarray) -> float:
    """Return how far [m] the middle of points (N, 3) lies outside of their footing; 0 inside.

    The mean of a surface stands in for the centre of mass: exact for shells, close for boards and boxes. A surface that
    was seen from one side shifts it by half the thickness, which is what CLEARANCE is for.
    """
    hull = footing(points)
    middle = shapely.Point(points[:, :2].mean(axis=0))
    return float(shapely.MultiPoint(hull).convex_hull.distance(middle))


def is_tilted(child: Entity) -> bool:
    """Whether the largest face of an object leans."""
    largest = max((patch.plane for patch in child.patches), key=lambda plane: plane.area, default=None)
    return largest is not None and TILTED[0] < abs(largest.normal[2]) < TILTED[1]


def footing_seen(child: Entity, carrier: Entity) -> bool:
    """Whether an object was seen down to its carrier. The back of a chair behind a table has a footing too, which
    says nothing about the chair's."""
    at = np.asarray(child.box.center[:2])
    gaps = [child.bottom - plane_height(carrier.patches[k].plane, at) for k in carrier.supporting]
    return not gaps or min(abs(gap) for gap in gaps) <= FOOTING_GAP


def is_unbalanced(child: Entity) -> bool:
    """Whether an object would fall over if nothing but its footing carried it. Articulated furniture stands on its own:
    an open door takes the middle of its surface outwards, and hardly its weight."""
    if len(child.points) < LEAST_TOUCHING or child.node_type == "articulated":
        return False
    height = child.top - child.bottom
    share = TILTED_SHARE if is_tilted(child) else CLEARANCE_SHARE
    return overhang(child.points) > max(CLEARANCE, share * height)


def leaning_relation(child: Entity, parent: str, entities: list[Entity]) -> Relation | None:
    """Return `leans_on`: what an unbalanced object touches beside its carrier `parent`, the nearest of all; else None.

    The contact must lie at LEAST_HEIGHT of its height or above, and on the side to which it would fall. The confidence
    falls from 1 at contact to 0.5 at TOUCH.
    """
    carrier = next((entity for entity in entities if entity.name == parent), None)
    if carrier is not None and not footing_seen(child, carrier):
        return None
    if not is_unbalanced(child):
        return None
    middle = child.points[:, :2].mean(axis=0)
    outward = middle - footing(child.points).mean(axis=0)
    outward /= max(float(np.linalg.norm(outward)), 1e-9)
    high = child.points[child.points[:, 2] >= child.bottom + LEAST_HEIGHT * (child.top - child.bottom)]
    best: tuple[float, int, str] | None = None
    for support in entities:
        if (
            support.name in (child.name, parent)
            or support.class_name in ("floor", "ceiling")
            or not len(support.points)
        ):
            continue
        distance, nearest = cKDTree(support.points).query(high, distance_upper_bound=TOUCH)
        touching = np.isfinite(distance)
        if np.count_nonzero(touching) < LEAST_TOUCHING:
            continue
        contact = support.points[nearest[touching], :2].mean(axis=0)
        if (contact - middle) @ outward <= 0.0:
            continue
        candidate = (float(np.sort(distance[touching])[LEAST_TOUCHING - 1]), support.instance, support.name)
        best = candidate if best is None else min(best, candidate)
    if best is None:
        return None
    return Relation(
        source=best[2], target=child.name, relation="leans_on", confidence=1.0 - 0.5 * best[0] / TOUCH, gap=best[0]
    )

"""Places where something can stand: horizontal planes of the models, confirmed by rays down to the real surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import open3d as o3d
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.synthesize.furniture import Furnishing
from scenewright.stages.synthesize.recipes import Place

if TYPE_CHECKING:
    from scenewright.stages.synthesize.placement import PlacedObject

CONTACT_TOLERANCE = 1e-3
"""A contact point that hangs further than this over the surface is not supported [m]."""
INSIDE_DEPTH = 0.02
"""A surface this far below the top of its model is inside it [m]."""


def sample_stand(
    target: PlacedObject, item: Furnishing, place: Place, random: np.random.Generator
) -> tuple[np.ndarray, int, bool] | None:
    """Return (world_from_model of the item, index of the plane, whether it is inside the target), or None.

    A plane is drawn by area among those that the rule allows, then a point on its rectangle; the item stands where
    rays from all its contact points meet the target's surface at one height.
    """
    base = float(target.world_from_model[2, 3])
    top = float(np.asarray(target.furnishing.mesh.vertices)[:, 2].max())
    surfaces = target.furnishing.surfaces
    first_drawer = len(target.furnishing.planes)
    choices = [
        k
        for k, plane in enumerate(surfaces)
        if (k >= first_drawer) == (place.surface == "drawer") and _is_allowed(plane, base, top, place)
    ]
    if not choices:
        return None
    areas = np.sqrt([surfaces[k].area for k in choices])
    index = int(random.choice(choices, p=areas / areas.sum()))
    plane = surfaces[index]
    corners = np.asarray(plane.corners)[:, :2]
    low, high = corners.min(axis=0), corners.max(axis=0)
    yaw = float(random.uniform(-place.yaw_spread, place.yaw_spread)) if place.yaw_spread else 0.0
    # `side` and `front` are shares of where the item's origin can be with its whole foot on the rectangle.
    foot = apply(transform_from_yaw(yaw, np.zeros(3)), item.contacts)[:, :2]
    low, high = low - foot.min(axis=0), high - foot.max(axis=0)
    if np.any(low > high):
        return None
    share = np.array([random.uniform(*place.side), random.uniform(*place.front)])
    point = low + share * (high - low)
    local = transform_from_yaw(yaw, np.array([*point, -plane.offset / plane.normal[2]]))
    height = _rest(target.furnishing, item.contacts, local)
    if height is None:
        return None
    local[2, 3] = height
    if not _is_reachable(target.furnishing, item, local):
        return None
    return target.world_from_model @ local, index, height < top - INSIDE_DEPTH


def _is_allowed(plane: SurfacePlane, base: float, top: float, rule: Place) -> bool:
    if not plane.horizontal or plane.hidden or len(plane.corners) != 4:
        return False
    level = -plane.offset / plane.normal[2]
    inside = level < top - INSIDE_DEPTH
    if (rule.surface == "inside" and not inside) or (rule.surface == "top" and inside):
        return False
    return rule.height is None or rule.height[0] <= base + level <= rule.height[1]


def _is_reachable(target: Furnishing, item: Furnishing, target_from_item: np.ndarray) -> bool:
    """Whether rays from the item's middle leave the target upwards, or all three of them (left, middle, right)
    through its front (-y): nobody puts things behind closed doors."""
    size = item.closed_size
    middle = target_from_item[:3, 3] + [0.0, 0.0, 0.5 * size[2]]
    side = np.array([0.3 * size[0], 0.0, 0.0])
    starts = np.array([middle, middle - side, middle, middle + side])
    directions = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
    rays = np.concatenate([starts, directions], axis=1).astype(np.float32)
    free = ~np.isfinite(target.triangles.scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy())
    return bool(free[0] or free[1:].all())


def _rest(target: Furnishing, contacts: np.ndarray, target_from_item: np.ndarray) -> float | None:
    """Return the height of the item's origin in the target frame at which all contact points touch, or None."""
    points = apply(target_from_item, contacts)
    start = points + np.array([0.0, 0.0, 0.01])
    rays = np.concatenate([start, np.tile([0.0, 0.0, -1.0], (len(points), 1))], axis=1).astype(np.float32)
    distance = target.triangles.scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy().astype(np.float64)
    drop = distance - 0.01
    if not np.isfinite(drop).all() or np.abs(drop).max() > 0.01 or np.ptp(drop) > CONTACT_TOLERANCE:
        return None
    return float(target_from_item[2, 3] - drop.min())

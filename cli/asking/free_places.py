"""Free level places of the seen surface that are large enough for a thing.

A level plane of a node is laid out in cells; a cell is free where the node has surface at that height and no other
surface stands within the height of the thing over it. A place is the middle of the largest free disc.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scenewright.cli.asking.asked_scene import AskedScene
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.scene_parts import SurfacePlane
from scipy import ndimage

CELL = 0.02
"""Edge of a cell [m]: that of the map's voxels."""
LEVEL = 0.025
"""Surface this close to a plane is of it; what rises higher stands on it [m]."""
CLOSED = 2
"""Cells across which gaps of the seen surface are closed: half of what the least foot covers."""


@dataclass(frozen=True)
class FreePlace:
    """Where a thing can stand."""

    on: str
    """Node."""
    center: tuple[float, float, float]
    """On the surface [m, world]."""
    radius: float
    """Of the largest free disc there [m]."""
    area: float
    """Free area of the surface [m^2]."""


def free_places(scene: AskedScene, radius: float, height: float, but: frozenset[str] = frozenset()) -> list[FreePlace]:
    """Return a place for a foot of this radius and height [m] on every level surface that has one, the roomiest first;
    none on the nodes `but`."""
    if scene.graph is None:
        return []
    points = np.concatenate([mesh.vertices for mesh in scene.meshes.values()])
    owner = np.repeat(list(scene.meshes), [len(mesh.vertices) for mesh in scene.meshes.values()])
    found = []
    for node in scene.graph.nodes:
        if node.instance in scene.meshes and node.id not in but and node.class_name not in ("wall", "ceiling"):
            best = max(_places_on(node, points, owner, radius, height), key=lambda p: p.radius, default=None)
            found += [best] if best is not None else []
    return sorted(found, key=lambda place: (-place.radius, place.on))


def _places_on(
    node: GraphNode, points: np.ndarray, owner: np.ndarray, radius: float, height: float
) -> Iterator[FreePlace]:
    for plane in node.planes:
        if plane.horizontal and not plane.hidden and plane.corners:
            place = _place_on(node, plane, points, owner, radius, height)
            if place is not None:
                yield place


def _place_on(
    node: GraphNode, plane: SurfacePlane, points: np.ndarray, owner: np.ndarray, radius: float, height: float
) -> FreePlace | None:
    corners = np.array(plane.corners)[:, :2]
    low, high, level = corners.min(axis=0), corners.max(axis=0), plane.center[2]
    shape = np.maximum(np.ceil((high - low) / CELL).astype(int), 1) + 2
    inside = np.all((points[:, :2] >= low) & (points[:, :2] < high), axis=1)
    over = inside & (points[:, 2] > level + LEVEL) & (points[:, 2] < level + max(height, 2 * LEVEL))
    surface = inside & (owner == node.instance) & (np.abs(points[:, 2] - level) <= LEVEL)
    free = ndimage.binary_closing(_cells(points[surface], low, shape), iterations=CLOSED)
    free &= ~ndimage.binary_dilation(_cells(points[over], low, shape))
    if not free.any():
        return None
    room = CELL * ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    best = np.unravel_index(int(room.argmax()), room.shape)
    if room[best] < radius:
        return None
    x, y = low + (np.array(best) - 0.5) * CELL
    center = (round(float(x), 3), round(float(y), 3), round(float(level), 3))
    return FreePlace(node.id, center, round(float(room[best]), 3), round(float(free.sum()) * CELL**2, 3))


def _cells(points: np.ndarray, low: np.ndarray, shape: np.ndarray) -> np.ndarray:
    cells = np.zeros(shape, bool)
    at = np.floor((points[:, :2] - low) / CELL).astype(int) + 1
    cells[at[:, 0], at[:, 1]] = True
    return cells

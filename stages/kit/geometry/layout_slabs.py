"""Thick convex slabs that stand for floors, ceilings and walls in physics.

A reconstructed floor is a thin bumpy sheet, and a scene's walls are often one entity whose box is the whole room;
neither can be given to a physics engine as it is. A slab starts at the surface and goes away from the room.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_scene import ShellPanel
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import Box, SurfacePlane
from scenewright.stages.kit.geometry.boxes import box_corners, box_rotation
from scenewright.stages.kit.geometry.transforms import transform_from, transform_from_quaternion

FLOOR_THICKNESS = 0.2
"""Thickness of the slab of a floor or ceiling [m]; by eye."""
FLOOR_MARGIN = 0.5
"""How far the floor goes on beyond what was seen of it [m]."""
WALL_THICKNESS = 0.1
"""Thickness of the slab of a wall [m]; by eye."""
THIN_LAYOUT = ("door", "window", "curtain")
THIN_THICKNESS = 0.05
"""Thickness of the slab of a door, window or curtain [m]; by eye."""
MINIMUM_AREA = 0.2
"""Smaller upright surfaces get no slab [m^2]."""


@dataclass(frozen=True)
class Slab:
    """A box: world_from_slab (4, 4) of its centre, full edge lengths (3,) [m]."""

    world_from_slab: np.ndarray
    size: np.ndarray


def slabs_of_panel(panel: ShellPanel) -> list[Slab]:
    """Return what is full of a plate of the shell as boxes in the world."""
    slabs = []
    for left, low, right, top in panel.boxes:
        middle = [0.5 * (left + right), 0.5 * (low + top), -0.5 * panel.thickness]
        frame = np.array(panel.world_from_panel) @ transform_from(np.eye(3), np.array(middle))
        slabs.append(Slab(frame, np.array([right - left, top - low, panel.thickness])))
    return slabs


def slabs_of_layout(
    name: str,
    class_name: str,
    planes: Sequence[SurfacePlane],
    box: Box,
    mesh: trimesh.Trimesh | None,
    graph: ContactGraphFile,
    room_center: np.ndarray,
) -> list[Slab]:
    """Return the slabs that stand for a layout node in physics: one for a floor or ceiling, one for each surface of a
    wall. `planes`, `mesh` (or None) and `box`: what is known of it, world frame; `graph` says which planes carry
    something; `room_center` (3,): the side on which the room is."""
    if class_name in ("floor", "ceiling"):
        upwards = class_name == "floor"
        height = level_of_layout(name, class_name, planes, box, mesh, graph)
        return [level_slab(box_under(name, box, graph), height, downwards=upwards)]
    thickness = THIN_THICKNESS if class_name in THIN_LAYOUT else WALL_THICKNESS
    return wall_slabs(planes, mesh, box, room_center, thickness)


def level_of_layout(
    name: str,
    class_name: str,
    planes: Sequence[SurfacePlane],
    box: Box,
    mesh: trimesh.Trimesh | None,
    graph: ContactGraphFile,
) -> float:
    """Return the height [m] of the face towards the room that a floor's or ceiling's slab has: of the planes that carry
    something, when any does (`surface_height`)."""
    carrying = {link.plane for link in graph.links if link.source == name}
    used = [plane for k, plane in enumerate(planes) if k in carrying]
    return surface_height(used or planes, mesh, box, upwards=class_name == "floor")


def box_under(name: str, box: Box, graph: ContactGraphFile) -> Box:
    """Return the box of a floor, as wide as what the graph says stands on it: the floor goes on under what was seen
    standing beyond its mapped edge."""
    standing = {link.target for link in graph.links if link.source == name and link.relation == "supports"}
    boxes = [node.box for node in graph.nodes if node.id in standing and node.box is not None]
    if not boxes:
        return box
    turn = box_rotation(box)
    corners = (np.concatenate([box_corners(box_of_other) for box_of_other in boxes]) - np.array(box.center)) @ turn
    half = 0.5 * np.array(box.size)
    low, high = np.minimum(corners.min(axis=0), -half), np.maximum(corners.max(axis=0), half)
    low[2], high[2] = -half[2], half[2]
    center = np.array(box.center) + turn @ (0.5 * (low + high))
    return box.model_copy(update={"center": as_vector(center), "size": as_vector(high - low)})


def level_slab(box: Box, height: float, *, downwards: bool) -> Slab:
    """Return a level slab over the footprint of `box` and a margin; its face towards the room is at `height`."""
    frame = transform_from_quaternion(np.asarray(box.orientation), np.asarray(box.center))
    frame[2, 3] = height + (-0.5 if downwards else 0.5) * FLOOR_THICKNESS
    return Slab(frame, np.array([box.size[0] + 2 * FLOOR_MARGIN, box.size[1] + 2 * FLOOR_MARGIN, FLOOR_THICKNESS]))


def surface_height(planes: Sequence[SurfacePlane], mesh: trimesh.Trimesh | None, box: Box, *, upwards: bool) -> float:
    """Return the height [m] of a floor (`upwards`) or a ceiling.

    The largest horizontal plane that looks into the room; else the area-weighted median height of such triangles of
    the mesh (world frame); else the face of the box.
    """
    sign = 1.0 if upwards else -1.0
    fitting = [plane for plane in planes if sign * plane.normal[2] > 0.9 or (plane.horizontal and upwards)]
    if fitting:
        return float(max(fitting, key=lambda plane: plane.area).center[2])
    if mesh is not None and len(mesh.faces):
        level = sign * mesh.face_normals[:, 2] > 0.9
        if level.any():
            heights, areas = mesh.triangles_center[level, 2], mesh.area_faces[level]
            order = np.argsort(heights, kind="stable")
            return float(heights[order][np.searchsorted(np.cumsum(areas[order]), 0.5 * areas.sum())])
    return float(box.center[2] + sign * 0.5 * box.size[2])


def wall_slabs(
    planes: Sequence[SurfacePlane],
    mesh: trimesh.Trimesh | None,
    box: Box,
    room_center: np.ndarray,
    thickness: float = WALL_THICKNESS,
) -> list[Slab]:
    """Return a slab behind every upright surface of a wall (seen from `room_center` (3,)).

    Surfaces: planes with corners; else those found on the mesh (world frame); else the box, when it is thin. An
    empty list when none is known: the entity then has no collision shape.
    """
    rectangles = [
        np.asarray(plane.corners)
        for plane in planes
        if len(plane.corners) == 4 and abs(plane.normal[2]) < 0.3 and plane.area >= MINIMUM_AREA
    ]
    if not rectangles and mesh is not None and len(mesh.faces):
        rectangles = upright_rectangles(mesh)
    slabs = [slab for slab in (_behind(corners, room_center, thickness) for corners in rectangles) if slab is not None]
    if not slabs and min(box.size[:2]) < 0.35:
        frame = transform_from_quaternion(np.asarray(box.orientation), np.asarray(box.center))
        size = np.asarray(box.size, dtype=float)
        axis = int(np.argmin(size[:2]))
        grow = max(thickness - size[axis], 0.0)
        away = np.sign(frame[:3, axis] @ (frame[:3, 3] - room_center)) or 1.0
        frame[:3, 3] += 0.5 * grow * away * frame[:3, axis]
        size[axis] += grow
        slabs = [Slab(frame, np.maximum(size, 1e-3))]
    return slabs


def _behind(corners: np.ndarray, room_center: np.ndarray, thickness: float) -> Slab | None:
    """Return the slab whose one face is the rectangle (4, 3) and that lies on its side away from the room."""
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    lengths = np.array([np.linalg.norm(first), np.linalg.norm(second)])
    if lengths.min() < 0.02:
        return None
    first = first / lengths[0]
    second = second / lengths[1]
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal)
    second = np.cross(normal, first)
    center = corners.mean(axis=0)
    away = 1.0 if normal @ (center - room_center) >= 0 else -1.0
    frame = transform_from(np.column_stack([first, second, normal]), center + 0.5 * thickness * away * normal)
    return Slab(frame, np.array([*lengths, thickness]))


def upright_rectangles(mesh: trimesh.Trimesh, *, maximum: int = 12) -> list[np.ndarray]:
    """Return the corners (4, 3) of the large upright planar parts of a mesh (world frame, z up), largest first.

    Area-weighted histograms: the commonest direction of upright triangles (5 degrees), then their commonest offset
    (2 cm); the rectangle holds 98 % of them. Repeats on what is left.
    """
    normals, centers, areas = mesh.face_normals, mesh.triangles_center, mesh.area_faces
    is_upright = np.abs(normals[:, 2]) < 0.3
    rectangles = []
    for _ in range(maximum):
        if areas[is_upright].sum() < MINIMUM_AREA:
            break
        angle = np.arctan2(normals[is_upright, 1], normals[is_upright, 0])
        bins = np.floor((angle + np.pi) / np.radians(5)).astype(int) % 72
        histogram = np.bincount(bins, weights=areas[is_upright], minlength=72)
        peak = int(np.argmax(histogram + np.roll(histogram, 1) + np.roll(histogram, -1)))
        in_peak = np.abs((bins - peak + 36) % 72 - 36) <= 1
        mean = (normals[is_upright][in_peak, :2] * areas[is_upright][in_peak, None]).sum(axis=0)
        direction = np.array([*(mean / np.linalg.norm(mean)), 0.0])
        aligned = is_upright & (normals @ direction > np.cos(np.radians(15)))
        offsets = centers[aligned] @ direction
        steps = np.floor((offsets - offsets.min()) / 0.02).astype(int)
        best = int(np.argmax(np.convolve(np.bincount(steps, weights=areas[aligned]), np.ones(3), mode="same")))
        at = offsets.min() + (best + 0.5) * 0.02
        inliers = aligned & (np.abs(centers @ direction - at) < 0.05)
        if areas[inliers].sum() < MINIMUM_AREA:
            is_upright &= ~aligned
            continue
        is_upright &= ~inliers
        tangent = np.array([-direction[1], direction[0], 0.0])
        (u0, u1), (z0, z1) = (
            np.percentile(values, [1, 99]) for values in (centers[inliers] @ tangent, centers[inliers, 2])
        )
        rectangles.append(
            np.array([at * direction + u * tangent + [0, 0, z] for u, z in ((u0, z0), (u1, z0), (u1, z1), (u0, z1))])
        )
    return rectangles

"""Tableware as triangle meshes: dishes are thin-walled tapered shells, utensils bent strips with a head.

A dish is the revolution of a cone's wall of even thickness over a flat floor of the same thickness; a utensil is an
outline in plan of even vertical thickness, flat or on a spine that arches between the two places where it rests. Their
volumes are known in closed form; at which heights shells nest is in `items.rise`.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.stages.tableware.world.items import Item, Measures

SIDES = 64
"""Corners of a dish's circles as a mesh; by eye."""
HEAD_SHARE = 0.36
"""Share of a utensil's length that is its head."""
NECK_SHARE, HANDLE_SHARE = 0.32, 0.55
"""Widths of the neck and of the handle's end against the head's."""
TINES, GAP_SHARE = 4, 0.45
"""A fork's tines, and the share of its head's width that is gaps."""


def shell_mesh(shell: Measures, sides: int = SIDES) -> trimesh.Trimesh:
    """Return the watertight mesh of a shell, foot centre at the origin, z up [m]."""
    if not shell.is_dish or shell.wall >= shell.height or min(shell.inner_radius(shell.wall), shell.rim_radius) <= 0.0:
        raise ValueError(f"no dish has these measures: {shell}")
    rings = [(shell.foot_radius, 0.0), (shell.rim_radius, shell.height)]
    rings += [(shell.inner_radius(z), z) for z in (shell.height, shell.wall)]
    angles = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = [np.column_stack([radius * circle, np.full(sides, z)]) for radius, z in rings]
    points.append(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, shell.wall]]))
    side, following = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = []
    for lower in range(len(rings) - 1):
        a, b = lower * sides, (lower + 1) * sides
        faces.append(np.column_stack([a + side, a + following, b + following]))
        faces.append(np.column_stack([a + side, b + following, b + side]))
    bottom, floor = 4 * sides, 4 * sides + 1
    faces.append(np.column_stack([following, side, np.full(sides, bottom)]))
    faces.append(np.column_stack([3 * sides + side, 3 * sides + following, np.full(sides, floor)]))
    return trimesh.Trimesh(np.concatenate(points), np.concatenate(faces), process=False)


def spine_height(share: float | np.ndarray, arch: float) -> float | np.ndarray:
    """Return the height [m] of a utensil's underside at a share 0..1 of its length from the handle's end.

    It rests on both ends; the neck, where the head begins, stands highest, by `arch` [m].
    """
    share = np.asarray(share, dtype=np.float64)
    neck = 1.0 - HEAD_SHARE
    along = np.where(share < neck, share / neck, (1.0 - share) / HEAD_SHARE)
    return arch * np.sin(0.5 * np.pi * np.clip(along, 0.0, 1.0)) ** 2


def spoon_half_width(strip: Measures, share: float | np.ndarray) -> float | np.ndarray:
    """Return half the width [m] of a spoon at a share 0..1 of its length from the handle's end."""
    share = np.asarray(share, dtype=np.float64)
    neck = 1.0 - HEAD_SHARE
    handle = 0.5 * strip.width * (HANDLE_SHARE + (NECK_SHARE - HANDLE_SHARE) * np.clip(share / neck, 0.0, 1.0))
    along = np.clip((share - neck) / HEAD_SHARE, 0.0, 1.0)
    head = 0.5 * strip.width * np.sqrt(np.clip(1.0 - (2.0 * along - 1.0) ** 2, 0.0, 1.0))
    return np.where(share < neck, handle, np.maximum(head, np.where(along < 0.5, 0.5 * strip.width * NECK_SHARE, 0.0)))


def _prism(
    stations: np.ndarray, low: np.ndarray, high: np.ndarray, under: np.ndarray, thickness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (vertices, faces) of a closed strip over stations (N,) along x between y = low and y = high (N,)."""
    count = len(stations)
    corners = []
    for y, lift in ((low, 0.0), (high, 0.0), (high, thickness), (low, thickness)):
        corners.append(np.column_stack([stations, y, under + lift]))
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    faces = []
    for k in range(count - 1):
        a, b = 4 * k, 4 * (k + 1)
        for side in range(4):
            next_side = (side + 1) % 4
            faces += [[a + side, a + next_side, b + next_side], [a + side, b + next_side, b + side]]
    end = 4 * (count - 1)
    faces += [[0, 2, 1], [0, 3, 2], [end, end + 1, end + 2], [end, end + 2, end + 3]]
    return vertices, np.array(faces)


def utensil_parts(strip: Measures, fork: bool, stations: int = 48) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return the plan of a utensil as strips (x (N,), low y (N,), high y (N,)) [m]; x = 0 is the middle, the head is
    at positive x."""
    if not fork:
        share = np.linspace(0.0, 1.0, stations)
        half = np.maximum(spoon_half_width(strip, share), 2e-4)
        return [((share - 0.5) * strip.length, -half, half)]
    neck, root = 1.0 - HEAD_SHARE, 1.0 - 0.6 * HEAD_SHARE
    share = np.linspace(0.0, root, stations)
    opening = np.clip((share - neck) / (root - neck), 0.0, 1.0)
    half = np.where(
        share < neck,
        spoon_half_width(strip, np.minimum(share, neck - 1e-9)),
        0.5 * strip.width * (NECK_SHARE + (1.0 - NECK_SHARE) * np.sin(0.5 * np.pi * opening)),
    )
    parts = [((share - 0.5) * strip.length, -half, half)]
    tine = strip.width * (1.0 - GAP_SHARE) / TINES
    pitch = (strip.width - tine) / (TINES - 1)
    along = (np.linspace(root, 1.0, 12) - 0.5) * strip.length
    for k in range(TINES):
        low = -0.5 * strip.width + k * pitch
        parts.append((along, np.full(12, low), np.full(12, low + tine)))
    return parts


def utensil_mesh(strip: Measures, fork: bool, arch: float = 0.0) -> trimesh.Trimesh:
    """Return the watertight mesh of a utensil that rests on z = 0, its middle at the origin, its head at positive x."""
    vertices, faces, first = [], [], 0
    for x, low, high in utensil_parts(strip, fork):
        under = np.asarray(spine_height(x / strip.length + 0.5, arch))
        points, triangles = _prism(x, low, high, under, strip.height)
        vertices.append(points)
        faces.append(triangles + first)
        first += len(points)
    return trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)


def item_mesh(item: Item, arch: float = 0.0) -> trimesh.Trimesh:
    """Return the mesh of an item where it stands, world frame [m]; `arch` bends utensils."""
    mesh = shell_mesh(item.measures) if item.is_dish else utensil_mesh(item.measures, item.kind == "fork", arch)
    pose = trimesh.transformations.rotation_matrix(item.yaw, [0.0, 0.0, 1.0])
    pose[:3, 3] = item.position
    mesh.apply_transform(pose)
    return mesh

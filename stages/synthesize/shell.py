"""Floor, walls and ceiling of a room as slabs around the empty inside; the origin is the middle of the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.synthesize.recipes import Shell

THICKNESS = 0.05
"""Thickness of every slab, outside the room [m]."""


@dataclass(frozen=True)
class Layout:
    """One slab."""

    class_name: str
    minimum: np.ndarray
    """(3,) [m]."""
    maximum: np.ndarray
    plane: SurfacePlane
    """The side that looks into the room, world frame."""
    mesh: trimesh.Trimesh
    """World frame."""
    inward: np.ndarray
    """(3,) unit normal into the room."""


@dataclass(frozen=True)
class Room:
    """The empty room: inside from -size/2 to size/2 in x and y, from 0 to the height in z."""

    size: np.ndarray
    """(3,) width, depth, height [m]."""
    layouts: tuple[Layout, ...]
    floor_color: tuple[int, int, int]
    wall_color: tuple[int, int, int]

    @property
    def walls(self) -> tuple[Layout, ...]:
        """The four walls."""
        return tuple(layout for layout in self.layouts if layout.class_name == "wall")

    def holds(self, minimum: np.ndarray, maximum: np.ndarray, tolerance: float = 1e-4) -> bool:
        """Whether bounds (..., 3) lie inside the room."""
        half = np.array([self.size[0] / 2, self.size[1] / 2])
        inside = np.all(minimum[..., :2] >= -half - tolerance) and np.all(maximum[..., :2] <= half + tolerance)
        return bool(inside and np.all(minimum[..., 2] >= -tolerance) and np.all(maximum[..., 2] <= self.size[2]))


def build_room(shell: Shell, random: np.random.Generator) -> Room:
    """Draw the size and colours of a room and build its slabs: floor, four walls (y+, x-, y-, x+), ceiling."""
    size = np.array([random.uniform(*shell.width), random.uniform(*shell.depth), random.uniform(*shell.height)])
    floor_color = shell.floor_colors[int(random.integers(len(shell.floor_colors)))]
    wall_color = shell.wall_colors[int(random.integers(len(shell.wall_colors)))]
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    t = THICKNESS
    slabs = [
        ("floor", (-x - t, -y - t, -t), (x + t, y + t, 0.0), (0, 0, 1), floor_color),
        ("wall", (-x, y, 0.0), (x, y + t, z), (0, -1, 0), wall_color),
        ("wall", (-x - t, -y - t, 0.0), (-x, y + t, z), (1, 0, 0), wall_color),
        ("wall", (-x, -y - t, 0.0), (x, -y, z), (0, 1, 0), wall_color),
        ("wall", (x, -y - t, 0.0), (x + t, y + t, z), (-1, 0, 0), wall_color),
    ]
    if shell.ceiling:
        slabs.append(("ceiling", (-x - t, -y - t, z), (x + t, y + t, z + t), (0, 0, -1), (244, 243, 238)))
    layouts = []
    for name, low, high, inward, color in slabs:
        minimum, maximum, normal = np.array(low, float), np.array(high, float), np.array(inward, float)
        mesh = trimesh.creation.box(bounds=np.stack([minimum, maximum]))
        mesh.visual.face_colors = np.array([*color, 255], dtype=np.uint8)
        layouts.append(Layout(name, minimum, maximum, _inner_plane(minimum, maximum, normal, size), mesh, normal))
    return Room(size, tuple(layouts), floor_color, wall_color)


def _inner_plane(minimum: np.ndarray, maximum: np.ndarray, normal: np.ndarray, size: np.ndarray) -> SurfacePlane:
    """The rectangle of a slab that bounds the inside of the room."""
    half = np.array([size[0] / 2, size[1] / 2, np.inf])
    low, high = np.maximum(minimum, -half), np.minimum(maximum, half)
    axis = int(np.argmax(np.abs(normal)))
    level = maximum[axis] if normal[axis] > 0 else minimum[axis]
    low[axis] = high[axis] = level
    u, v = [k for k in range(3) if k != axis]
    corners = []
    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
        corner = low.copy()
        corner[u] = (low[u], high[u])[a]
        corner[v] = (low[v], high[v])[b]
        corners.append(as_vector(corner))
    return SurfacePlane(
        normal=as_vector(normal),
        offset=float(-normal[axis] * level),
        area=float((high[u] - low[u]) * (high[v] - low[v])),
        center=as_vector((low + high) / 2),
        corners=tuple(corners),
        horizontal=bool(normal[2] > 0.5),
    )

"""What the links of a kinematic tree look like, as triangles in their link's frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.part_colors import vertex_colors
from scenewright.stages.kit.formats.urdf_file import Link, Shape
from scenewright.stages.kit.geometry.transforms import apply

GREY = (0.6, 0.6, 0.6, 1.0)
"""Colour of links without one (RGBA, 0 to 1)."""


@dataclass(frozen=True)
class Surface:
    """Triangles of one colour, or of a colour a vertex."""

    vertices: np.ndarray
    """(V, 3) float32 [m], link frame."""
    faces: np.ndarray
    """(F, 3) uint32."""
    color: tuple[float, float, float, float]
    """sRGB and alpha in 0..1."""
    vertex_colors: np.ndarray | None = None
    """(V, 3) uint8 sRGB, when the file colours its vertices."""


def link_surfaces(link: Link, root: Path) -> list[Surface]:
    """Return what a link looks like, one entry a visual shape that has triangles; meshes lie relative to `root`.

    Raises BadInput for a mesh that is missing or torn.
    """
    return [surface for shape in link.visuals if (surface := _surface(shape, root)) is not None]


def _surface(shape: Shape, root: Path) -> Surface | None:
    if shape.mesh is not None:
        mesh = read_mesh(root / shape.mesh, may_be_empty=True, hint="make the scene again")
        colors = vertex_colors(mesh) if len(mesh.faces) else None
    else:
        assert shape.box_size is not None
        mesh, colors = trimesh.creation.box(shape.box_size), None
    if len(mesh.faces) == 0:
        return None
    vertices = apply(shape.link_from_shape, shape.scale * np.asarray(mesh.vertices, dtype=float))
    return Surface(
        np.ascontiguousarray(vertices, dtype=np.float32),
        np.ascontiguousarray(mesh.faces, dtype=np.uint32),
        shape.color or GREY,
        None if colors is None else np.ascontiguousarray(colors, dtype=np.uint8),
    )

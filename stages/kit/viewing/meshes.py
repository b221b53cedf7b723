"""Loading meshes for views. A torn file is bad input, as everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.urdf_file import Shape
from scenewright.stages.kit.geometry.boxes import box_rotation
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.viewing.canvas import Canvas, Color, bytes_of


def load_mesh(path: Path) -> trimesh.Trimesh:
    """Return the mesh in a file, in file order. Raises BadInput."""
    return read_mesh(path, may_be_empty=True)


def merged(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several meshes (at least one) as one."""
    combined: Any = meshes[0] if len(meshes) == 1 else trimesh.util.concatenate(meshes)
    return combined


def draw_solid(path: str, box: Box, color: Color, canvas: Canvas) -> None:
    """Draw a box as a body in one colour, where `Canvas.boxes` draws its edges."""
    mesh = trimesh.creation.box(box.size, transform_from(box_rotation(box), np.array(box.center)))
    canvas.mesh(path, mesh, np.tile(np.array(bytes_of(color), np.uint8), (len(mesh.vertices), 1)))


def shape_mesh(shape: Shape, folder: Path) -> trimesh.Trimesh:
    """Return the mesh of a URDF shape in its link's frame [m]; mesh files lie relative to `folder`. Raises BadInput."""
    if shape.mesh is not None:
        mesh = load_mesh(folder / shape.mesh.removeprefix("package://"))
        mesh.apply_scale(shape.scale)
    else:
        assert shape.box_size is not None
        mesh = trimesh.creation.box(shape.box_size)
    plain = isinstance(mesh.visual, trimesh.visual.ColorVisuals) and not mesh.visual.defined
    if shape.color is not None and plain:
        rgba = np.round(255 * np.array(shape.color)).astype(np.uint8)
        mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.tile(rgba, (len(mesh.vertices), 1)))
    mesh.apply_transform(shape.link_from_shape)
    return mesh

"""Loading meshes for views. A torn file is bad input, as everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from stages.kit.formats.mesh_files import read_mesh
from stages.kit.formats.urdf_file import Shape


def load_mesh(path: Path) -> trimesh.Trimesh:
    """Return the mesh in a file, in file order. Raises BadInput."""
    return read_mesh(path, may_be_empty=True)


def merged(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several meshes (at least one) as one."""
    whole: Any = meshes[0] if len(meshes) == 1 else trimesh.util.concatenate(meshes)
    return whole


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

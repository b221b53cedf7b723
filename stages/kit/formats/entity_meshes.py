"""Meshes of a panoptic map's entities as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from schemas.errors import BadInput


@dataclass(frozen=True)
class EntityMesh:
    """Vertices (V, 3) float64 [m], faces (F, 3) int64, colours (V, 3) uint8."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray


def load_entity_mesh(path: Path) -> EntityMesh:
    """Read a PLY mesh in file order. Raises BadInput when it is missing, torn or without triangles."""
    if not Path(path).is_file():
        raise BadInput(f"{path}: file is missing", hint="make the panoptic map again")
    try:
        mesh = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # trimesh raises whatever its parser raises
        raise BadInput(f"{path}: cannot be read as a mesh: {error}", hint="make the panoptic map again") from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise BadInput(f"{path}: holds no triangles", hint="make the panoptic map again")
    vertices = np.asarray(mesh.vertices, dtype=float)
    if not np.isfinite(vertices).all():
        raise BadInput(f"{path}: vertices are not finite", hint="make the panoptic map again")
    visual = mesh.visual
    if isinstance(visual, trimesh.visual.ColorVisuals):
        colors = np.asarray(visual.vertex_colors)[:, :3].astype(np.uint8)
    else:
        colors = np.full((len(vertices), 3), 128, dtype=np.uint8)
    return EntityMesh(vertices, np.asarray(mesh.faces, dtype=np.int64), colors)

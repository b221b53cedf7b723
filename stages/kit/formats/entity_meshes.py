"""Meshes of a panoptic map's entities as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scenewright.stages.kit.formats.mesh_files import read_mesh


@dataclass(frozen=True)
class EntityMesh:
    """Vertices (V, 3) float64 [m], faces (F, 3) int64, colours (V, 3) uint8."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray


def load_entity_mesh(path: Path) -> EntityMesh:
    """Read a PLY mesh in file order. Raises BadInput when it is missing, torn or without triangles."""
    mesh = read_mesh(path, hint="make the panoptic map again")
    vertices = np.asarray(mesh.vertices, dtype=float)
    visual = mesh.visual
    if isinstance(visual, trimesh.visual.ColorVisuals):
        colors = np.asarray(visual.vertex_colors)[:, :3].astype(np.uint8)
    else:
        colors = np.full((len(vertices), 3), 128, dtype=np.uint8)
    return EntityMesh(vertices, np.asarray(mesh.faces, dtype=np.int64), colors)

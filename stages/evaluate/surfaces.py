"""Reading meshes for measurement."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.mesh_files import read_mesh


@dataclass(frozen=True)
class Surface:
    """A triangle mesh."""

    vertices: np.ndarray
    """(V, 3) [m]."""
    triangles: np.ndarray
    """(F, 3)."""


def read_surface(path: Path) -> Surface:
    """Read a PLY in file order of its vertices. Raises BadInput for a missing or broken file."""
    mesh = read_mesh(path, may_be_empty=True)
    vertices = np.asarray(mesh.vertices, dtype=float).reshape(-1, 3)
    return Surface(vertices, np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3))

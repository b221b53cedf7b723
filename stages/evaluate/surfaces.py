"""Reading meshes for measurement."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from schemas.errors import BadInput


@dataclass(frozen=True)
class Surface:
    """A triangle mesh."""

    vertices: np.ndarray
    """(V, 3) [m]."""
    triangles: np.ndarray
    """(F, 3)."""


EMPTY = Surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))


def read_surface(path: Path) -> Surface:
    """Read a PLY in file order of its vertices. Raises BadInput for a missing or broken file."""
    import trimesh

    if not path.is_file():
        raise BadInput(f"{path}: file is missing", hint="make the artifact again")
    if _declares_no_vertices(path):
        return EMPTY
    try:
        loaded = trimesh.load(path, process=False)
    except Exception as error:  # trimesh raises whatever its parser stumbled over
        raise BadInput(f"{path}: {error}", hint="make the artifact again") from None
    vertices = np.asarray(getattr(loaded, "vertices", np.zeros((0, 3))), dtype=float)
    triangles = np.asarray(getattr(loaded, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
    if not np.isfinite(vertices).all() or (len(triangles) and triangles.max() >= len(vertices)):
        raise BadInput(f"{path}: vertices are not finite or triangles point beyond them")
    return Surface(vertices.reshape(-1, 3), triangles)


def _declares_no_vertices(path: Path) -> bool:
    with path.open("rb") as file:
        header = file.read(2048)
    return b"element vertex 0\n" in header or b"element vertex 0\r" in header

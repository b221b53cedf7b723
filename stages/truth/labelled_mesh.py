"""The mesh half of SceneNN's annotation: a PLY whose vertices carry the property `label`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mesh_files import read_mesh

HINT = "give SceneNN's <scene>.ply, not a mesh of colours alone"


@dataclass(frozen=True)
class LabelledMesh:
    """vertices (V, 3) float64 [m] in the log's world, faces (F, 3), labels (V,) int64 (0: not annotated)."""

    vertices: np.ndarray
    faces: np.ndarray
    labels: np.ndarray


def read_labelled_mesh(path: Path) -> LabelledMesh:
    """Read a PLY with a vertex property `label`, binary or text.

    Raises BadInput for a missing or broken file, one whose vertices have no label, or labels that are no integers >= 0.
    """
    if path.suffix.lower() != ".ply":
        raise BadInput(f"{path}: no PLY", hint=HINT)
    mesh = read_mesh(path, hint=HINT)
    # trimesh keeps the columns of the file here, whatever their names.
    columns = mesh.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    names = () if columns is None else (columns.dtype.names or ()) if isinstance(columns, np.ndarray) else columns
    if columns is None or "label" not in names:
        raise BadInput(f"{path}: its vertices have no property `label`", hint=HINT)
    labels = np.asarray(columns["label"]).reshape(-1)
    if len(labels) != len(mesh.vertices):
        raise BadInput(f"{path}: {len(labels)} labels for {len(mesh.vertices)} vertices", hint=HINT)
    integers = labels.astype(np.int64)
    if (integers != labels).any() or (integers < 0).any():
        raise BadInput(f"{path}: labels that are not integers from 0 on", hint=HINT)
    return LabelledMesh(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64), integers)

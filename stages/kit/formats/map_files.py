"""The files of a panoptic map that more than one step writes: names of meshes, faces of labels, arrays."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
from scenewright.stages.kit.formats.ply_files import ColoredMesh

FIXED_TIMESTAMP = (1980, 1, 1, 0, 0, 0)
"""Time of all entries of the archive, so that equal maps have equal bytes: the earliest that ZIP can hold."""


class Painted(Protocol):
    """A surface of triangles with colours."""

    @property
    def vertices(self) -> np.ndarray:
        """(V, 3) float32 [m]."""

    @property
    def faces(self) -> np.ndarray:
        """(F, 3) int32."""

    @property
    def colors(self) -> np.ndarray:
        """(V, 3) uint8."""


def mesh_name(instance: int) -> str:
    """Return the name of an entity's mesh within the artifact."""
    return f"entities/{instance}.ply"


def face_labels(labels: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the label (F,) of every face: that of its vertices when they agree, else 0.

    A face between two labels belongs to neither: its far vertex would widen a cup by a voxel on every side.
    """
    corners = labels[faces]
    agree = (corners[:, 0] == corners[:, 1]) & (corners[:, 1] == corners[:, 2])
    return np.where(agree, corners[:, 0], 0)


def cut_mesh(surface: Painted, chosen: np.ndarray) -> ColoredMesh:
    """Return the chosen faces (indices) as a mesh of their own; vertices and faces keep their order."""
    faces = surface.faces[chosen]
    used, places = np.unique(faces, return_inverse=True)
    return ColoredMesh(surface.vertices[used], places.astype(np.int32).reshape(-1, 3), surface.colors[used])


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays as NPZ that np.load reads: names sorted, fixed time stamps, fast compression, the same bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in sorted(arrays):
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=FIXED_TIMESTAMP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            with archive.open(entry, "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.ascontiguousarray(arrays[name]), allow_pickle=False)

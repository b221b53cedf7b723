"""Triangle meshes as binary PLY: the same mesh gives the same bytes."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content

_VERTEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")])
_FACE = np.dtype([("count", "u1"), ("indices", "<i4", (3,))])
"""A triangle in a binary PLY: the count 3 and three indices."""
_HEADER = (
    "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n"
    "property float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
)


LARGEST_FILE = 4 * 2**30
"""Largest PLY file [bytes]: a map of over a hundred million triangles."""


@dataclass(frozen=True)
class ColoredMesh:
    """vertices (V, 3) float32 [m], faces (F, 3) int32, colors (V, 3) uint8."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray


def canonical_order(mesh: ColoredMesh) -> tuple[ColoredMesh, np.ndarray]:
    """Return the mesh in an order that depends on its shape only, and for each new vertex its old number (V,).

    Vertices ascend by z, then y, then x (then colour); faces begin with their smallest vertex, keep their winding, and
    ascend.
    """
    columns = (*mesh.colors.T[::-1], *mesh.vertices.T)
    order = np.lexsort(columns)
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    faces = rank[mesh.faces].reshape(-1, 3)
    turn = faces.argmin(axis=1)[:, None]
    faces = np.take_along_axis(faces, (turn + np.arange(3)) % 3, axis=1)
    faces = faces[np.lexsort(faces.T[::-1])]
    return ColoredMesh(mesh.vertices[order], faces, mesh.colors[order]), order


def write_ply(path: Path, mesh: ColoredMesh) -> None:
    """Write a mesh in the order it has. Raises ValueError for wrong shapes or indices."""
    vertices, faces, colors = (np.asarray(a) for a in (mesh.vertices, mesh.faces, mesh.colors))
    if vertices.ndim != 2 or vertices.shape[1] != 3 or colors.shape != vertices.shape:
        raise ValueError(f"vertices {vertices.shape} and colours {colors.shape} are not (V, 3) both")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"faces {faces.shape} are not (F, 3)")
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError(f"a face refers to a vertex outside of 0..{len(vertices) - 1}")
    table = np.zeros(len(vertices), dtype=_VERTEX)
    for k, name in enumerate("xyz"):
        table[name] = vertices[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        table[name] = colors[:, k]
    rows = np.zeros(len(faces), dtype=_FACE)
    rows["count"] = 3
    rows["indices"] = faces
    with Path(path).open("wb") as file:
        file.write(_HEADER.format(vertices=len(vertices), faces=len(faces)).encode("ascii"))
        file.write(table.tobytes())
        file.write(rows.tobytes())


def read_ply(path: Path) -> ColoredMesh:
    """Read a mesh that write_ply wrote. Raises BadInput when it is missing, torn or of another layout."""
    data = file_content(path, LARGEST_FILE)
    lines = io.BytesIO(data)
    header = b""
    counts = {}
    while not header.endswith(b"end_header\n"):
        line = lines.readline(200)
        if not line.endswith(b"\n"):
            raise BadInput(f"{path}: no PLY header")
        words = line.split()
        if len(words) == 3 and words[0] == b"element" and words[2].isdigit():
            counts[words[1].decode("ascii", "replace")] = int(words[2])
        header += line
    vertices, faces = counts.get("vertex", -1), counts.get("face", -1)
    if header != _HEADER.format(vertices=vertices, faces=faces).encode("ascii"):
        raise BadInput(f"{path}: PLY of another layout", hint="expected binary, x y z red green blue and triangles")
    body = data[len(header) :]
    split = vertices * _VERTEX.itemsize
    if len(body) != split + faces * _FACE.itemsize:
        raise BadInput(f"{path}: torn: {len(body)} bytes, expected {split + faces * _FACE.itemsize}")
    table = np.frombuffer(body[:split], dtype=_VERTEX)
    rows = np.frombuffer(body[split:], dtype=_FACE)
    triangles = rows["indices"].astype(np.int32)
    if (rows["count"] != 3).any() or (faces and (triangles.min() < 0 or triangles.max() >= vertices)):
        raise BadInput(f"{path}: a face is not a triangle of its vertices")
    return ColoredMesh(
        np.stack([table[name] for name in "xyz"], axis=1).astype(np.float32),
        triangles,
        np.stack([table[name] for name in ("red", "green", "blue")], axis=1),
    )

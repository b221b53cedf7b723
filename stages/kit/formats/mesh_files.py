"""Meshes out of PLY, OBJ, STL and GLB files that nobody vouches for.

What the parsers leave out is checked around them: sizes that are declared but not there (they would reserve memory for
them, or return an empty scene), vertices that are no numbers, faces that point nowhere. A mesh file is read by itself:
nothing that it names (materials, textures, buffers) is opened.
"""

from __future__ import annotations

import io
import json
import math
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import cast

import numpy as np
import trimesh

from schemas.errors import BadInput
from schemas.outside import file_content

LARGEST_FILE = 4 * 2**30
"""Bytes."""
LARGEST_HEADER = 64 * 2**10
_GLB_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_GLB_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def read_mesh(path: Path, *, may_be_empty: bool = False, hint: str = "make the artifact again") -> trimesh.Trimesh:
    """Return the mesh in a file, vertices and faces in file order [m], with the vertex colours of the file.

    Raises BadInput when it is missing, torn, of an unknown format, declares more than it holds, has vertices that are
    not finite or faces that name no vertex, or (unless `may_be_empty`) has no triangles.
    """
    path = Path(path)
    check = _CHECKS.get(path.suffix.lower())
    if check is None:
        raise BadInput(f"{path}: not a mesh format that is read", hint=f"known: {', '.join(sorted(_CHECKS))}")
    data = file_content(path, LARGEST_FILE, hint=hint)
    return mesh_of_bytes(data, path.suffix.lower(), str(path), may_be_empty=may_be_empty, hint=hint)


def mesh_of_bytes(
    data: bytes, suffix: str, where: str, *, may_be_empty: bool = False, hint: str = "make the artifact again"
) -> trimesh.Trimesh:
    """Return the mesh in the bytes of a file with this suffix (`.stl`), as `read_mesh` does; errors name `where`."""
    path = where
    try:
        mesh = None if _CHECKS[suffix](data) else _parse(data, suffix.removeprefix("."))
    except BadInput as error:
        raise BadInput(f"{path}: {error.message}", hint=hint) from None
    mesh = mesh or trimesh.Trimesh(process=False)
    _check_mesh(mesh, path, may_be_empty=may_be_empty, hint=hint)
    return mesh if len(mesh.faces) else trimesh.Trimesh(mesh.vertices, np.zeros((0, 3), np.int64), process=False)


def meshes_of_glb(data: bytes, where: str, *, hint: str = "make the artifact again") -> list[trimesh.Trimesh]:
    """Return the meshes of a GLB one by one, where its nodes put them [m], with colours or textures of their own.

    Raises BadInput, beginning with `where`, as `read_mesh` does.
    """
    try:
        _check_glb(data)
        scene = trimesh.load(io.BytesIO(data), file_type="glb", process=False, force="scene")
        meshes = [mesh for mesh in cast(trimesh.Scene, scene).dump() if isinstance(mesh, trimesh.Trimesh)]
    except BadInput as error:
        raise BadInput(f"{where}: {error.message}", hint=hint) from None
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{where}: cannot be read as a mesh: {reason:.120}", hint=hint) from None
    if not meshes:
        raise BadInput(f"{where}: holds no triangles", hint=hint)
    for mesh in meshes:
        _check_mesh(mesh, where, may_be_empty=False, hint=hint)
    return meshes


def _check_mesh(mesh: trimesh.Trimesh, path: str, *, may_be_empty: bool, hint: str) -> None:
    if mesh.vertices.ndim != 2 or mesh.vertices.shape[1] != 3:
        raise BadInput(f"{path}: vertices of {mesh.vertices.shape[1:]} numbers, expected 3", hint=hint)
    if len(mesh.faces) == 0:
        if not may_be_empty:
            raise BadInput(f"{path}: holds no triangles", hint=hint)
    elif mesh.faces.ndim != 2 or mesh.faces.shape[1] != 3:
        raise BadInput(f"{path}: faces are not triangles", hint=hint)
    if not np.isfinite(mesh.vertices).all():
        raise BadInput(f"{path}: vertices are not finite", hint=hint)
    if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise BadInput(f"{path}: a face names a vertex outside of 0..{len(mesh.vertices) - 1}", hint=hint)


def _parse(data: bytes, kind: str) -> trimesh.Trimesh | None:
    try:
        # From memory and without a resolver, so that names inside the file lead nowhere.
        loaded = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"cannot be read as a mesh: {reason:.120}") from None
    if isinstance(loaded, trimesh.Trimesh):
        return loaded
    if isinstance(loaded, trimesh.PointCloud):
        raise BadInput("holds points, not triangles")
    return None


def _check_ply(data: bytes) -> bool:
    """Return whether it declares no vertices. Raises BadInput when it declares more elements than it has bytes."""
    end = data.find(b"end_header", 0, LARGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise BadInput("no PLY header")
    body = len(data) - end - len(b"end_header")
    counts = re.findall(rb"^[ \t]*element[ \t]+(\S+)[ \t]+(\S+)", data[:end], re.MULTILINE)
    vertices = 0
    for name, count in counts:
        if not count.isdigit() or len(count) > 18 or int(count) > body:
            raise BadInput(f"declares {count[:20]!r} of {name[:20]!r}, but holds {body} bytes")
        vertices += int(count) if name == b"vertex" else 0
    return vertices == 0


def _check_stl(data: bytes) -> bool:
    """Return whether it declares no triangles. Raises BadInput when the count of a binary STL is not what follows."""
    if data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:LARGEST_HEADER]:
        return False
    if len(data) < 84:
        raise BadInput("no STL: shorter than its header")
    (count,) = struct.unpack_from("<I", data, 80)
    if 84 + 50 * count != len(data):
        raise BadInput(f"declares {count} triangles, which take {84 + 50 * count} bytes; the file has {len(data)}")
    return count == 0


def _check_obj(data: bytes) -> bool:
    """Return whether it has no vertices. Raises BadInput when it holds bytes that no text has."""
    if b"\0" in data:
        raise BadInput("no OBJ: holds zero bytes")
    return re.search(rb"^[ \t]*v[ \t]", data, re.MULTILINE) is None


def _check_glb(data: bytes) -> bool:
    """Return False. Raises BadInput unless every array lies inside the file itself and is as long as it claims."""
    if data[:4] != b"glTF" or len(data) < 20:
        raise BadInput("no GLB header")
    version, total, length = struct.unpack_from("<III", data, 4)
    if version != 2 or total != len(data) or 20 + length > total or data[16:20] != b"JSON":
        raise BadInput(f"GLB version {version} declares {total} bytes and {length} of JSON, the file has {len(data)}")
    try:
        tree = json.loads(data[20 : 20 + length])
        views = [(int(view.get("byteOffset", 0)), int(view["byteLength"])) for view in tree.get("bufferViews", ())]
        for begin, size in views:
            if begin < 0 or size < 0 or begin + size > total:
                raise BadInput(f"a buffer view ends at byte {begin + size}, the file at {total}")
        for accessor in tree.get("accessors", ()):
            need = (
                math.prod((accessor["count"], _GLB_COMPONENTS[accessor["type"]]))
                * _GLB_COMPONENT_BYTES[accessor["componentType"]]
            )
            have = views[accessor["bufferView"]][1]
            if not 0 <= need <= have:
                raise BadInput(f"an array needs {need} bytes, its buffer view has {have}")
        names = [item.get("uri") for part in ("buffers", "images") for item in tree.get(part, ())]
        if any(names):
            raise BadInput(f"names another file, {next(filter(None, names))!r:.60}")
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise BadInput(f"GLB description is broken: {type(error).__name__}: {error}"[:160]) from None
    return False


_CHECKS: dict[str, Callable[[bytes], bool]] = {
    ".ply": _check_ply,
    ".stl": _check_stl,
    ".obj": _check_obj,
    ".glb": _check_glb,
}

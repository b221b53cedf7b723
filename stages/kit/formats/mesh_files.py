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
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.gltf_extensions import CONVERTER, refuse_extensions
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE, image_size, may_be_decoded

LARGEST_FILE = 4 * 2**30
"""Largest mesh file [bytes]."""
LARGEST_HEADER = 64 * 2**10
"""Bytes in which the end of a PLY or STL header is looked for; by eye."""
MOST_TRIANGLES, MOST_VERTICES = 50_000_000, 150_000_000
"""Most triangles and vertices of a mesh where nothing else is asked for; those of a glTF count each time that a node
shows them."""
MOST_GLTF_VALUES = 1_000_000
"""Numbers, texts, lists and objects of a glTF description."""
MOST_NODES, DEEPEST_NODES = 5_000, 200
"""Most nodes of a glTF, and their deepest nesting; bounds, by eye."""
MOST_OVERLAP = 4
"""Bytes of the arrays of a GLB for one of the file."""
LARGEST_TEXT_MESH = 128 * 2**20
"""Bytes of a PLY or STL file that is text, for which trimesh takes ten times as much."""
REMEMBERED_BYTES = 2**15
"""Files up to this size are parsed once."""
_GLB_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Bytes a component by its type (glTF 2.0, 3.6.2.2)."""
_GLB_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Components an element by its type (glTF 2.0, 3.6.2.2)."""


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
    data: bytes,
    suffix: str,
    where: str,
    *,
    may_be_empty: bool = False,
    hint: str = "make the artifact again",
    most_triangles: int = MOST_TRIANGLES,
    most_vertices: int = MOST_VERTICES,
) -> trimesh.Trimesh:
    """Return the mesh in the bytes of a file with this suffix (`.stl`), as `read_mesh` does; errors name `where`.

    Raises BadInput too for more than so many triangles or vertices, before memory is taken for them.
    """
    path = where
    try:
        empty = _CHECKS[suffix](data)
        if suffix in _COUNTS:
            _check_counts(*_COUNTS[suffix](data), most_triangles, most_vertices)
        mesh = None if empty else _parse(data, suffix.removeprefix("."))
    except BadInput as error:
        raise BadInput(f"{path}: {error.message}", hint=error.hint or hint) from None
    mesh = mesh or trimesh.Trimesh(process=False)
    _check_mesh(mesh, path, may_be_empty=may_be_empty, hint=hint)
    return mesh if len(mesh.faces) else trimesh.Trimesh(mesh.vertices, np.zeros((0, 3), np.int64), process=False)


class Cloud(NamedTuple):
    """points (N, 3) float, colors (N, 3) uint8, grey where the file has none, and whether points have a label."""

    points: np.ndarray
    colors: np.ndarray
    labelled: bool


def read_cloud(path: Path, *, hint: str) -> Cloud | None:
    """Return the points of a PLY file without faces, None for one with faces. Raises BadInput as `read_mesh` does."""
    data = file_content(Path(path), LARGEST_FILE, hint=hint)
    header = data[:LARGEST_HEADER].partition(b"end_header")[0]
    try:
        if _check_ply(data) or re.search(rb"^[ \t]*element[ \t]+face[ \t]+0*[1-9]", header, re.MULTILINE):
            return None
        loaded = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
    except BadInput as error:
        raise BadInput(f"{path}: {error.message}", hint=hint) from None
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{path}: cannot be read as points: {reason:.120}", hint=hint) from None
    points = np.asarray(getattr(loaded, "vertices", np.zeros((0, 3))), dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
        raise BadInput(f"{path}: holds no points, or some that are not finite", hint=hint)
    colors = np.asarray(getattr(loaded, "colors", ()))
    if colors.ndim != 2 or len(colors) != len(points) or colors.shape[1] < 3:
        colors = np.full(points.shape, 160, np.uint8)
    labelled = re.search(rb"^[ \t]*property[ \t]+\S+[ \t]+label\s*$", header, re.MULTILINE) is not None
    return Cloud(points, colors[:, :3].astype(np.uint8), labelled)


def meshes_of_glb(
    data: bytes,
    where: str,
    *,
    hint: str = "make the artifact again",
    most_triangles: int = MOST_TRIANGLES,
    most_vertices: int = MOST_VERTICES,
) -> list[trimesh.Trimesh]:
    """Return the meshes of a GLB one by one, where its nodes put them [m], with colours or textures of their own.

    Raises BadInput, beginning with `where`, as `read_mesh` does.
    """
    try:
        _check_glb(data)
        _check_counts(*_glb_counts(data), most_triangles, most_vertices)
        scene = trimesh.load(io.BytesIO(data), file_type="glb", process=False, force="scene")
        meshes = [mesh for mesh in cast(trimesh.Scene, scene).dump() if isinstance(mesh, trimesh.Trimesh)]
    except BadInput as error:
        raise BadInput(f"{where}: {error.message}", hint=error.hint or hint) from None
    except Exception as error:  # trimesh raises whatever its parsers raise
        raise BadInput(f"{where}: {_torn('glTF')}", hint=hint) from error
    if not meshes:
        raise BadInput(f"{where}: holds no triangles", hint=hint)
    for mesh in meshes:
        _check_mesh(mesh, where, may_be_empty=False, hint=hint)
    return meshes


def _torn(kind: str) -> str:
    return f"cannot be read as {kind}: it is torn, or its parts do not fit what it declares"


def _check_counts(triangles: int, vertices: int, most_triangles: int, most_vertices: int) -> None:
    if triangles > most_triangles or vertices > most_vertices:
        raise BadInput(f"{triangles} triangles and {vertices} vertices, more than {most_triangles} and {most_vertices}")


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
    if len(data) > REMEMBERED_BYTES:
        return _load_mesh(data, kind)
    parsed = _parse_cached(data, kind)
    return parsed.copy() if parsed is not None else None


@lru_cache(maxsize=1024)
def _parse_cached(data: bytes, kind: str) -> trimesh.Trimesh | None:
    """Pieces of models and rooms are read again and again: to be checked, moved, drawn, measured."""
    return _load_mesh(data, kind)


def _load_mesh(data: bytes, kind: str) -> trimesh.Trimesh | None:
    try:
        # From memory and without a resolver, so that names inside the file lead nowhere.
        loaded = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
    except Exception as error:  # trimesh raises whatever its parsers raise
        raise BadInput(_torn(kind.upper())) from error
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
    if b"tristrips" in dict(counts):
        raise BadInput("its triangles are strips (tristrips), which are not read", hint="export it from MeshLab")
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


def whole_number(value: object) -> int:
    """Return a count, a length or an offset of a glTF. Raises ValueError for what is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 2**53 or value != int(value):
        raise ValueError(f"{value!r:.40} is not a whole number")
    return int(value)


def gltf_tree(text: bytes) -> dict[str, Any]:
    """Return a glTF description. Raises ValueError for what is no JSON object, or says more than any needs."""
    if sum(text.count(mark) for mark in (b",", b"[", b"{")) > MOST_GLTF_VALUES:  # before they take memory
        raise ValueError(f"more than {MOST_GLTF_VALUES} values")
    tree = json.loads(text)
    if not isinstance(tree, dict):
        raise ValueError("no JSON object")
    return tree


def _glb_tree(data: bytes) -> dict[str, Any]:
    (length,) = struct.unpack_from("<I", data, 12)
    return gltf_tree(data[20 : 20 + length])


@contextmanager
def _refuse_as_broken() -> Iterator[None]:
    try:
        yield
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else f"{type(error).__name__}: {error}"
        raise BadInput(f"GLB description is broken: {what}"[:160]) from None


def _check_glb(data: bytes) -> bool:
    """Return False. Raises BadInput unless every array lies inside the file itself and is as long as it claims.

    Views and arrays may overlap, but not so often that they are many times the file; nodes are a tree.
    """
    if data[:4] != b"glTF" or len(data) < 20:
        raise BadInput("no GLB header")
    version, total, length = struct.unpack_from("<III", data, 4)
    if version != 2 or total != len(data) or 20 + length > total or data[16:20] != b"JSON":
        raise BadInput(f"GLB version {version} declares {total} bytes and {length} of JSON, the file has {len(data)}")
    with _refuse_as_broken():
        tree = _glb_tree(data)
        refuse_extensions(tree, "IN.glb")
        if any("sparse" in accessor for accessor in tree.get("accessors", ())):
            raise BadInput("an array is sparse, which is not read here", hint=f"{CONVERTER} copy IN.glb OUT.glb")
        views = [
            (whole_number(view.get("byteOffset", 0)), whole_number(view["byteLength"]))
            for view in tree.get("bufferViews", ())
        ]
        for begin, size in views:
            if begin + size > total:
                raise BadInput(f"a buffer view ends at byte {begin + size}, the file at {total}")
        needs = []
        for accessor in tree.get("accessors", ()):
            need = (
                math.prod((whole_number(accessor["count"]), _GLB_COMPONENTS[accessor["type"]]))
                * _GLB_COMPONENT_BYTES[accessor["componentType"]]
            )
            have = views[whole_number(accessor["bufferView"])][1]
            if need > have:
                raise BadInput(f"an array needs {need} bytes, its buffer view has {have}")
            needs.append(need)
        if max(sum(size for _, size in views), sum(needs)) > MOST_OVERLAP * total:
            raise BadInput(f"its arrays are more than {MOST_OVERLAP} times the file")
        names = [item.get("uri") for part in ("buffers", "images") for item in tree.get(part, ())]
        if any(names):
            raise BadInput(f"names another file, {next(filter(None, names))!r:.60}")
        _times_shown(tree)
    return False


def _times_shown(tree: dict[str, Any]) -> list[int]:
    """Return how often the nodes show each mesh. Raises BadInput unless the nodes are trees of bounded depth."""
    nodes = tree.get("nodes", [])
    if len(nodes) > MOST_NODES:
        raise BadInput(f"{len(nodes)} nodes, more than {MOST_NODES}")
    times = [0] * len(tree.get("meshes", ()))
    parents: dict[int, int] = {}
    for number, node in enumerate(nodes):
        if node.get("mesh") is not None:
            times[whole_number(node["mesh"])] += 1
        for child in map(whole_number, node.get("children", ())):
            if child in parents or child >= len(nodes):
                raise BadInput(f"node {child} hangs on two nodes, or does not exist")
            parents[child] = number
    depths: dict[int, int] = {}
    for number in range(len(nodes)):
        path_of_nodes = []
        at: int | None = number
        while at is not None and at not in depths:
            path_of_nodes.append(at)
            if len(path_of_nodes) > DEEPEST_NODES:
                raise BadInput(f"nodes are nested deeper than {DEEPEST_NODES}, or in a circle")
            at = parents.get(at)
        depth = 0 if at is None else depths[at]
        for passed_node in reversed(path_of_nodes):
            depth += 1
            depths[passed_node] = depth
        if depth > DEEPEST_NODES:
            raise BadInput(f"nodes are nested deeper than {DEEPEST_NODES}, or in a circle")
    return times if nodes else [1] * len(times)


def _glb_counts(data: bytes) -> tuple[int, int]:
    """Return the triangles and the vertices of a checked GLB, each mesh as often as it is shown, and once more."""
    with _refuse_as_broken():
        tree = _glb_tree(data)
        counts = [whole_number(accessor["count"]) for accessor in tree.get("accessors", ())]
        triangles = vertices = 0
        for mesh, times in zip(tree.get("meshes", ()), _times_shown(tree), strict=True):
            for primitive in mesh["primitives"]:
                corners = counts[whole_number(primitive["attributes"]["POSITION"])]
                index_count = counts[whole_number(primitive["indices"])] if "indices" in primitive else corners
                strip = primitive.get("mode", 4) != 4
                triangles += max(times, 1) * (index_count if strip else index_count // 3)
                vertices += max(times, 1) * corners
    return triangles, vertices


def gltf_pixels(data: bytes, where: str, *, hint: str = "make the artifact again") -> int:
    """Return the pixels of a GLB's pictures, each as often as it would be decoded: once for every shown primitive.

    Pictures whose header is of no known kind count as the largest. Raises BadInput, beginning with `where`.
    """
    try:
        _check_glb(data)
        with _refuse_as_broken():
            return _pixels(data)
    except BadInput as error:
        raise BadInput(f"{where}: {error.message}", hint=error.hint or hint) from None


def _pixels(data: bytes) -> int:
    tree = _glb_tree(data)
    (length,) = struct.unpack_from("<I", data, 12)
    start, views = 28 + length, tree.get("bufferViews", [])
    sizes = []
    for image in tree.get("images", ()):
        view = views[whole_number(image["bufferView"])]
        begin = start + whole_number(view.get("byteOffset", 0))
        picture = data[begin : begin + whole_number(view["byteLength"])]
        size = image_size(picture) if may_be_decoded(picture) else None
        sizes.append(LARGEST_IMAGE if size is None else size[0] * size[1])
    times = _times_shown(tree)
    triangles_of_material = [0] * len(tree.get("materials", ()))
    for mesh, count in zip(tree.get("meshes", ()), times, strict=True):
        for primitive in mesh["primitives"]:
            if primitive.get("material") is not None:
                triangles_of_material[whole_number(primitive["material"])] += max(count, 1)
    pixels = sum(sizes)
    for material, count in zip(tree.get("materials", ()), triangles_of_material, strict=True):
        for owner in (material, material.get("pbrMetallicRoughness", {})):
            for key, texture in owner.items():
                if key.endswith("Texture"):
                    source = tree["textures"][whole_number(texture["index"])].get("source")
                    pixels += 0 if source is None else count * sizes[whole_number(source)]
    return pixels


def _ply_counts(data: bytes) -> tuple[int, int]:
    header = data[:LARGEST_HEADER].partition(b"end_header")[0]
    if b"format ascii" in header and len(data) > LARGEST_TEXT_MESH:
        raise BadInput(f"a text of more than {LARGEST_TEXT_MESH} bytes", hint="save it as binary PLY")
    counts = {b"vertex": 0, b"face": 0, b"other": 0}
    for name, count in re.findall(rb"^[ \t]*element[ \t]+(\S+)[ \t]+(\d{1,18})", header, re.MULTILINE):
        counts[name if name in counts else b"other"] += int(count)
    return counts[b"face"], counts[b"vertex"] + counts[b"other"]


def _stl_counts(data: bytes) -> tuple[int, int]:
    if data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:LARGEST_HEADER]:
        if len(data) > LARGEST_TEXT_MESH:
            raise BadInput(f"a text of more than {LARGEST_TEXT_MESH} bytes", hint="save it as binary STL")
        corners = data.count(b"vertex")
        return corners // 3, corners
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else 0
    return count, 3 * count


_COUNTS: dict[str, Callable[[bytes], tuple[int, int]]] = {".ply": _ply_counts, ".stl": _stl_counts, ".glb": _glb_counts}
"""Triangles and vertices that the bytes of a file declare or hold."""
_CHECKS: dict[str, Callable[[bytes], bool]] = {
    ".ply": _check_ply,
    ".stl": _check_stl,
    ".obj": _check_obj,
    ".glb": _check_glb,
}

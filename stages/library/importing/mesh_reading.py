"""One mesh file of any format into painted surfaces, with the unit and the up axis that it declares."""

from __future__ import annotations

import base64
import io
import json
import struct
from array import array
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mesh_files import gltf_pixels, gltf_tree, mesh_of_bytes, meshes_of_glb, whole_number
from scenewright.stages.library.importing.collada_file import parse_collada
from scenewright.stages.library.importing.limits import MOST_SHAPES, MOST_TRIANGLES, MOST_VERTICES, SIMPLIFY
from scenewright.stages.library.importing.pictures import MOST_PIXELS, Pictures, face_colors
from scenewright.stages.library.importing.source_folder import LARGEST_FILE, LARGEST_TEXT, SourceFolder
from scenewright.stages.library.importing.source_model import Declared, Surface, painted_faces

MESH_SUFFIXES = (".obj", ".stl", ".dae", ".glb", ".gltf", ".ply")
LARGEST_MATERIALS = 16 * 2**20
"""Most bytes of all material files of a mesh; a bound, by eye."""
MOST_MATERIAL_FILES = 100
"""Most material files of a mesh that are looked at; a bound, by eye."""
MOST_KEPT_FILES = 1000
"""Most mesh files that are kept in memory; by eye."""
MOST_LINES = 20_000_000
"""Most lines of an OBJ file; a bound, by eye."""
LONGEST_LINE = 1 << 20
"""Characters of a line of an OBJ file."""
Y_UP = (0.0, 1.0, 0.0)
"""Up direction of mesh formats that have y upwards, as the specification of glTF says."""
HINT = "export it again"


@dataclass(frozen=True)
class MeshContent:
    """Surfaces in the file's frame and unit."""

    surfaces: tuple[Surface, ...]
    unit: Declared
    up: Declared
    findings: tuple[str, ...] = ()

    @property
    def triangles(self) -> int:
        """How many there are."""
        return sum(len(surface.faces) for surface in self.surfaces)


def read_mesh_file(folder: SourceFolder, path: Path) -> MeshContent:
    """Return what a mesh file holds. Raises BadInput when it is torn, too large or of no known format.

    The last files are kept, as descriptions name the same file again and again.
    """
    cache = folder.kept_meshes
    if path not in cache:
        try:
            content_or_error: MeshContent | BadInput = _read_mesh_file(folder, path)
        except BadInput as error:
            content_or_error = error
        size = 0 if isinstance(content_or_error, BadInput) else content_or_error.triangles
        while cache and size + sum(c.triangles for c in cache.values() if isinstance(c, MeshContent)) > MOST_TRIANGLES:
            del cache[next(iter(cache))]
        if len(cache) > MOST_KEPT_FILES:
            cache.clear()
        cache[path] = content_or_error
    content = cache[path]
    if isinstance(content, BadInput):
        raise BadInput(content.message, hint=content.hint)
    assert isinstance(content, MeshContent)
    return content


def _read_mesh_file(folder: SourceFolder, path: Path) -> MeshContent:
    kind = path.suffix.lower()
    if kind == ".dae":
        content = _read_collada(folder, path)
    elif kind == ".obj":
        content = _read_obj(folder, path)
    elif kind in (".glb", ".gltf"):
        content = _read_gltf(folder, path)
    elif kind in (".stl", ".ply"):
        mesh = mesh_of_bytes(
            folder.read(path), kind, str(path), hint=HINT, most_triangles=MOST_TRIANGLES, most_vertices=MOST_VERTICES
        )
        content = MeshContent((_surface_of(mesh, path.stem),), Declared(None, "assumed"), Declared(None, "assumed"))
    else:
        raise BadInput(f"{path}: not a mesh format that is read", hint=f"known: {', '.join(MESH_SUFFIXES)}")
    if content.triangles == 0:
        raise BadInput(f"{path}: holds no triangles")
    if content.triangles > MOST_TRIANGLES or len(content.surfaces) > MOST_SHAPES:
        raise BadInput(f"{path}: {content.triangles} triangles in {len(content.surfaces)} pieces", hint=SIMPLIFY)
    if any(not np.isfinite(surface.vertices).all() for surface in content.surfaces):
        raise BadInput(f"{path}: vertices are not finite")
    return content


def _surface_of(mesh: trimesh.Trimesh, name: str) -> Surface:
    faces = np.asarray(mesh.faces)
    colors = painted_faces(len(faces), None)
    visual = mesh.visual
    if isinstance(visual, trimesh.visual.TextureVisuals):
        image = getattr(visual.material, "baseColorTexture", None) or getattr(visual.material, "image", None)
        with suppress(Exception):  # Pillow raises whatever its decoders raise; the colour is then the plain one
            if visual.uv is not None and image is not None:
                colors = face_colors(np.asarray(image.convert("RGB")), np.asarray(visual.uv)[faces])
            else:
                colors = np.tile(np.asarray(visual.material.main_color, dtype=np.uint8)[:3], (len(faces), 1))
    elif visual is not None and visual.kind is not None:
        colors = np.asarray(visual.face_colors, dtype=np.uint8)[:, :3]
    return Surface(np.asarray(mesh.vertices, dtype=float), faces, colors, name)


def _read_collada(folder: SourceFolder, path: Path) -> MeshContent:
    content = parse_collada(folder.read(path, LARGEST_TEXT), str(path))
    surfaces: list[Surface] = []
    findings: list[str] = []
    if content.left_out:
        findings.append(f"{path.name}: left out: {', '.join(content.left_out)}")
    pictures = Pictures(folder, path, findings)
    for patch in content.patches:
        colors = painted_faces(len(patch.faces), None if patch.texture else patch.color)
        if patch.texture is not None and patch.texture_points is not None:
            picture = pictures.picture(patch.texture)
            if picture is not None:
                colors = face_colors(picture, patch.texture_points)
        surfaces.append(Surface(patch.vertices, patch.faces, colors, patch.name))
    unit = Declared(1.0, "format") if content.metres_per_unit is None else Declared(content.metres_per_unit, "file")
    up = Declared(Y_UP, "format") if content.up is None else Declared(content.up, "file")
    return MeshContent(tuple(surfaces), unit, up, tuple(findings))


def _lines(data: bytes, path: Path) -> Iterator[str]:
    """Yield the lines of a text, whatever ends them. Raises BadInput for one that does not end."""
    text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8", errors="replace")
    count = 0
    while line := text.readline(LONGEST_LINE):
        count += 1
        if len(line) == LONGEST_LINE:
            raise BadInput(f"{path}: a line of {LONGEST_LINE} characters or more", hint=HINT)
        if count > MOST_LINES:
            raise BadInput(f"{path}: more than {MOST_LINES} lines", hint=HINT)
        yield line


@dataclass
class _Block:
    """Triangles of one material and group while they are gathered: three numbers each."""

    corners: array[int]
    mapped: array[int]


def _read_obj(folder: SourceFolder, path: Path) -> MeshContent:
    """Read vertices, texture points, faces and materials; groups and objects give the surfaces their names."""
    data = folder.read(path, LARGEST_TEXT)
    if b"\0" in data:
        raise BadInput(f"{path}: no OBJ: holds zero bytes")
    vertices, texture = array("d"), array("d")
    blocks: dict[tuple[str, str], _Block] = {}
    libraries: dict[str, None] = {}
    material = group = ""
    triangle_count = 0
    try:
        for line in _lines(data, path):
            word, _, arguments = line.strip().partition(" ")
            if word == "v":
                x, y, z = (float(number) for number in arguments.split()[:3])
                vertices.extend((x, y, z))
            elif word == "vt":
                u, v = (float(number) for number in (arguments.split() + ["0"])[:2])
                texture.extend((u, v))
            elif word == "f":
                corners = [part.split("/") for part in arguments.split()]
                at = [_index(corner[0], len(vertices) // 3) for corner in corners]
                mapped = [_index(c[1], len(texture) // 2) if len(c) > 1 and c[1] else -1 for c in corners]
                block = blocks.setdefault((material, group), _Block(array("q"), array("q")))
                for k in range(1, len(at) - 1):
                    block.corners.extend((at[0], at[k], at[k + 1]))
                    block.mapped.extend((mapped[0], mapped[k], mapped[k + 1]))
                triangle_count += max(len(at) - 2, 0)
                if triangle_count > MOST_TRIANGLES or len(blocks) > MOST_SHAPES:
                    most = f"{MOST_TRIANGLES} triangles or {MOST_SHAPES} groups"
                    raise BadInput(f"{path}: more than {most}", hint=SIMPLIFY)
            elif word == "usemtl":
                material = arguments.strip()
            elif word in ("g", "o"):
                group = arguments.strip()
            elif word == "mtllib":
                libraries[arguments.strip()] = None
            if len(vertices) > 3 * MOST_VERTICES or len(texture) > 2 * MOST_VERTICES:
                raise BadInput(f"{path}: more than {MOST_VERTICES} vertices", hint=SIMPLIFY)
    except (ValueError, IndexError) as error:
        raise BadInput(f"{path}: cannot be read as OBJ: {error}"[:200]) from None
    blocks = {key: block for key, block in blocks.items() if block.corners}  # faces of two corners hold no triangle
    if not vertices or not blocks:
        raise BadInput(f"{path}: holds no triangles")
    materials = _read_materials(folder, path, list(libraries))
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    findings: list[str] = []
    if len(libraries) > MOST_MATERIAL_FILES:
        findings.append(f"{path.name}: {MOST_MATERIAL_FILES} of {len(libraries)} material files are looked at")
    uv = np.array(texture, dtype=float).reshape(-1, 2)
    pictures = Pictures(folder, path, findings)
    surfaces = []
    for (name, group_name), block in blocks.items():
        faces, chosen = np.array(block.corners).reshape(-1, 3), np.array(block.mapped).reshape(-1, 3)
        color, picture_name = materials.get(name, (None, None))
        colors = painted_faces(len(faces), color)
        if picture_name is not None and len(uv) and chosen.min() >= 0:
            picture = pictures.picture(picture_name)
            if picture is not None:
                colors = face_colors(picture, uv[chosen])
        used, inverse = np.unique(faces, return_inverse=True)
        surfaces.append(Surface(points[used], inverse.reshape(-1, 3), colors, f"{group_name} {name}".strip()))
    return MeshContent(tuple(surfaces), Declared(None, "assumed"), Declared(None, "assumed"), tuple(findings))


def _index(text: str, count: int) -> int:
    number = int(text)
    number = number - 1 if number > 0 else count + number
    if not 0 <= number < count:
        raise ValueError(f"a face names element {text} of {count}")
    return number


def _read_materials(
    folder: SourceFolder, path: Path, libraries: list[str]
) -> dict[str, tuple[tuple[float, float, float] | None, str | None]]:
    """Return material -> (diffuse colour, name of its picture) of the MTL files that can be found."""
    materials: dict[str, tuple[tuple[float, float, float] | None, str | None]] = {}
    found_files = dict.fromkeys(folder.find(name, path.parent) for name in libraries[:MOST_MATERIAL_FILES])
    remaining_bytes = LARGEST_MATERIALS
    for file in found_files:
        if file is None:
            continue
        current = ""
        data = folder.read(file, remaining_bytes)
        remaining_bytes -= len(data)
        for line in _lines(data, file):
            word, _, arguments = line.strip().partition(" ")
            if word == "newmtl":
                current = arguments.strip()
                materials.setdefault(current, (None, None))
            elif word == "Kd" and current:
                try:
                    red, green, blue = (float(x) for x in arguments.split()[:3])
                except ValueError:
                    continue
                if np.isfinite([red, green, blue]).all():
                    materials[current] = ((red, green, blue), materials[current][1])
            elif word == "map_Kd" and current and arguments.strip():
                materials[current] = (materials[current][0], arguments.split()[-1])
    return materials


def _read_gltf(folder: SourceFolder, path: Path) -> MeshContent:
    """Read a GLB, or a .gltf whose buffers lie beside it. glTF 2.0 section 3.4: metres, y up."""
    data = folder.read(path)
    findings: list[str] = []
    if path.suffix.lower() == ".gltf":
        data, findings = _pack(folder, path, data)
    elif gltf_pixels(data, str(path), hint=HINT) > MOST_PIXELS:
        data = _without_pictures(data)
        findings.append(f"{path.name}: its pictures are too large, colours are those of the materials")
    meshes = meshes_of_glb(data, str(path), hint=HINT, most_triangles=MOST_TRIANGLES, most_vertices=MOST_VERTICES)
    surfaces = tuple(_surface_of(mesh, str(mesh.metadata.get("name", ""))) for mesh in meshes)
    return MeshContent(surfaces, Declared(1.0, "format"), Declared(Y_UP, "format"), tuple(findings))


def _pack(folder: SourceFolder, path: Path, data: bytes) -> tuple[bytes, list[str]]:
    """Return a .gltf with its buffers as one GLB, pictures left out, and what has to be said about it."""
    findings: list[str] = []
    try:
        tree = gltf_tree(data)
        chunks, starts, length = [], [], 0
        for buffer in tree.get("buffers", []):
            starts.append(length)
            part = _buffer(folder, path, str(buffer["uri"]))[: whole_number(buffer["byteLength"])]
            chunks += [part, b"\0" * (-len(part) % 4)]
            length += len(part) + -len(part) % 4
            if length > LARGEST_FILE:
                raise BadInput(f"{path}: buffers of more than {LARGEST_FILE} bytes", hint=SIMPLIFY)
        for view in tree.get("bufferViews", []):
            view["byteOffset"] = whole_number(view.get("byteOffset", 0)) + starts[whole_number(view["buffer"])]
            view["buffer"] = 0
        tree["buffers"] = [{"byteLength": length}]
        if _drop_pictures(tree):
            findings.append(f"{path.name}: pictures are left out, colours are those of the materials")
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
        raise BadInput(f"{path}: glTF description is broken: {type(error).__name__}: {error}"[:200]) from None
    return _glb(tree, chunks), findings


def _drop_pictures(tree: dict[str, Any]) -> bool:
    """Take pictures and what names them out of a glTF description; return whether there were any."""
    had = bool(tree.pop("images", None))
    tree.pop("textures", None)
    for material in tree.get("materials", []):
        for owner in (material, material.get("pbrMetallicRoughness", {})):
            for key in [key for key in owner if key.endswith("Texture")]:
                del owner[key]
    return had


def _without_pictures(data: bytes) -> bytes:
    """Return a GLB that was looked through (`gltf_pixels`) without its pictures."""
    (length,) = struct.unpack_from("<I", data, 12)
    tree = gltf_tree(data[20 : 20 + length])
    _drop_pictures(tree)
    return _glb(tree, [data[28 + length :]])


def _glb(tree: dict[str, Any], chunks: list[bytes]) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    binary = sum(len(part) for part in chunks)
    head = struct.pack("<4sIII4s", b"glTF", 2, 12 + 8 + len(text) + 8 + binary, len(text), b"JSON")
    return b"".join([head, text, struct.pack("<I4s", binary, b"BIN\0"), *chunks])


def _buffer(folder: SourceFolder, path: Path, name: str) -> bytes:
    if name.startswith("data:"):
        try:
            return base64.b64decode(name.partition(",")[2], validate=True)
        except ValueError:  # binascii.Error, or letters that are none of ASCII
            raise BadInput(f"{path}: a buffer is no base64") from None
    file = folder.find(name, path.parent)
    if file is None:
        raise BadInput(f"{path}: buffer {name!r:.60} is not in the folder")
    return folder.read(file)

"""One mesh file of any format into painted surfaces, with the unit and the up axis that it declares."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from schemas.errors import BadInput
from stages.kit.formats.mesh_files import mesh_of_bytes, meshes_of_glb
from stages.library.importing.collada_file import parse_collada
from stages.library.importing.pictures import face_colors, read_picture
from stages.library.importing.source_folder import SourceFolder
from stages.library.importing.source_model import Declared, Surface, painted_faces

MESH_SUFFIXES = (".obj", ".stl", ".dae", ".glb", ".gltf", ".ply")
MOST_TRIANGLES = 2_000_000
LARGEST_GLTF = 64 * 2**20
Y_UP = (0.0, 1.0, 0.0)
HINT = "export it again"


@dataclass(frozen=True)
class MeshContent:
    """Surfaces in the file's frame and unit."""

    surfaces: tuple[Surface, ...]
    unit: Declared
    up: Declared
    findings: tuple[str, ...] = ()


def read_mesh_file(folder: SourceFolder, path: Path) -> MeshContent:
    """Return what a mesh file holds. Raises BadInput when it is torn, too large or of no known format."""
    kind = path.suffix.lower()
    if kind == ".dae":
        content = _read_collada(folder, path)
    elif kind == ".obj":
        content = _read_obj(folder, path)
    elif kind in (".glb", ".gltf"):
        content = _read_gltf(folder, path)
    elif kind in (".stl", ".ply"):
        mesh = mesh_of_bytes(folder.read(path), kind, str(path), hint=HINT)
        content = MeshContent((_surface_of(mesh, path.stem),), Declared(None, "assumed"), Declared(None, "assumed"))
    else:
        raise BadInput(f"{path}: not a mesh format that is read", hint=f"known: {', '.join(MESH_SUFFIXES)}")
    triangles = sum(len(surface.faces) for surface in content.surfaces)
    if triangles == 0:
        raise BadInput(f"{path}: holds no triangles")
    if triangles > MOST_TRIANGLES:
        raise BadInput(f"{path}: {triangles} triangles", hint=f"simplify it to at most {MOST_TRIANGLES}")
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
    content = parse_collada(folder.read(path), str(path))
    surfaces: list[Surface] = []
    findings: list[str] = []
    if content.left_out:
        findings.append(f"{path.name}: left out: {', '.join(content.left_out)}")
    pictures: dict[str, np.ndarray | None] = {}
    for patch in content.patches:
        colors = painted_faces(len(patch.faces), None if patch.texture else patch.color)
        if patch.texture is not None and patch.texture_points is not None:
            picture = _picture(folder, path, patch.texture, pictures, findings)
            if picture is not None:
                colors = face_colors(picture, patch.texture_points)
        surfaces.append(Surface(patch.vertices, patch.faces, colors, patch.name))
    unit = Declared(1.0, "format") if content.metres_per_unit is None else Declared(content.metres_per_unit, "file")
    up = Declared(Y_UP, "format") if content.up is None else Declared(content.up, "file")
    return MeshContent(tuple(surfaces), unit, up, tuple(findings))


def _picture(
    folder: SourceFolder, path: Path, name: str, pictures: dict[str, np.ndarray | None], findings: list[str]
) -> np.ndarray | None:
    if name not in pictures:
        found = folder.find(name, path.parent)
        pictures[name] = None if found is None else read_picture(folder, found)
        if pictures[name] is None:
            findings.append(f"{path.name}: picture {Path(name.replace(chr(92), '/')).name!r:.60} is not there")
    return pictures[name]


def _read_obj(folder: SourceFolder, path: Path) -> MeshContent:
    """Read vertices, texture points, faces and materials; groups and objects give the surfaces their names."""
    text = folder.read(path).decode("utf-8", "replace")
    if "\0" in text:
        raise BadInput(f"{path}: no OBJ: holds zero bytes")
    vertices: list[list[float]] = []
    texture: list[list[float]] = []
    blocks: dict[tuple[str, str], tuple[list[tuple[int, int, int]], list[tuple[int, int, int]]]] = {}
    libraries: list[str] = []
    material = group = ""
    try:
        for line in text.splitlines():
            word, _, rest = line.strip().partition(" ")
            if word == "v":
                vertices.append([float(x) for x in rest.split()[:3]])
            elif word == "vt":
                texture.append([float(x) for x in (rest.split() + ["0"])[:2]])
            elif word == "f":
                corners = [part.split("/") for part in rest.split()]
                at = [_index(corner[0], len(vertices)) for corner in corners]
                mapped = [_index(c[1], len(texture)) if len(c) > 1 and c[1] else -1 for c in corners]
                entry = blocks.setdefault((material, group), ([], []))
                for k in range(1, len(at) - 1):
                    entry[0].append((at[0], at[k], at[k + 1]))
                    entry[1].append((mapped[0], mapped[k], mapped[k + 1]))
            elif word == "usemtl":
                material = rest.strip()
            elif word in ("g", "o"):
                group = rest.strip()
            elif word == "mtllib":
                libraries.append(rest.strip())
    except (ValueError, IndexError) as error:
        raise BadInput(f"{path}: cannot be read as OBJ: {error}"[:200]) from None
    blocks = {key: block for key, block in blocks.items() if block[0]}  # faces of two corners hold no triangle
    if not vertices or not blocks or any(len(vertex) != 3 for vertex in vertices):
        raise BadInput(f"{path}: holds no triangles")
    materials = _read_materials(folder, path, libraries)
    points = np.array(vertices, dtype=float)
    findings: list[str] = []
    uv = np.array(texture, dtype=float).reshape(-1, 2)
    pictures: dict[str, np.ndarray | None] = {}
    surfaces = []
    for (name, group_name), (triangles, mapped_triangles) in blocks.items():
        faces, chosen = np.array(triangles), np.array(mapped_triangles)
        color, picture_name = materials.get(name, (None, None))
        colors = painted_faces(len(faces), color)
        if picture_name is not None and len(uv) and chosen.min() >= 0:
            picture = _picture(folder, path, picture_name, pictures, findings)
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
    for library in libraries:
        found = folder.find(library, path.parent)
        if found is None:
            continue
        current = ""
        for line in folder.read(found, LARGEST_GLTF).decode("utf-8", "replace").splitlines():
            word, _, rest = line.strip().partition(" ")
            if word == "newmtl":
                current = rest.strip()
                materials.setdefault(current, (None, None))
            elif word == "Kd" and current:
                try:
                    red, green, blue = (float(x) for x in rest.split()[:3])
                except ValueError:
                    continue
                if np.isfinite([red, green, blue]).all():
                    materials[current] = ((red, green, blue), materials[current][1])
            elif word == "map_Kd" and current and rest.strip():
                materials[current] = (materials[current][0], rest.split()[-1])
    return materials


def _read_gltf(folder: SourceFolder, path: Path) -> MeshContent:
    """Read a GLB, or a .gltf whose buffers lie beside it. glTF 2.0 section 3.4: metres, y up."""
    data = folder.read(path)
    findings: list[str] = []
    if path.suffix.lower() == ".gltf":
        data, findings = _packed(folder, path, data)
    surfaces = tuple(
        _surface_of(mesh, str(mesh.metadata.get("name", ""))) for mesh in meshes_of_glb(data, str(path), hint=HINT)
    )
    return MeshContent(surfaces, Declared(1.0, "format"), Declared(Y_UP, "format"), tuple(findings))


def _packed(folder: SourceFolder, path: Path, data: bytes) -> tuple[bytes, list[str]]:
    """Return a .gltf with its buffers as one GLB, pictures left out, and what has to be said about it."""
    findings: list[str] = []
    try:
        tree = json.loads(data)
        joined, starts = b"", []
        for buffer in tree.get("buffers", []):
            starts.append(len(joined))
            joined += _buffer(folder, path, str(buffer["uri"]))[: int(buffer["byteLength"])]
            joined += b"\0" * (-len(joined) % 4)
        for view in tree.get("bufferViews", []):
            view["byteOffset"] = int(view.get("byteOffset", 0)) + starts[int(view["buffer"])]
            view["buffer"] = 0
        tree["buffers"] = [{"byteLength": len(joined)}]
        if tree.pop("images", None):
            findings.append(f"{path.name}: pictures are left out, colours are those of the materials")
        tree.pop("textures", None)
        for material in tree.get("materials", []):
            for owner in (material, material.get("pbrMetallicRoughness", {})):
                for key in [key for key in owner if key.endswith("Texture")]:
                    del owner[key]
        text = json.dumps(tree).encode()
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise BadInput(f"{path}: glTF description is broken: {type(error).__name__}: {error}"[:200]) from None
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(joined)
    head = struct.pack("<4sIII4s", b"glTF", 2, total, len(text), b"JSON")
    return head + text + struct.pack("<I4s", len(joined), b"BIN\0") + joined, findings


def _buffer(folder: SourceFolder, path: Path, name: str) -> bytes:
    if name.startswith("data:"):
        try:
            return base64.b64decode(name.partition(",")[2], validate=True)
        except binascii.Error:
            raise BadInput(f"{path}: a buffer is no base64") from None
    found = folder.find(name, path.parent)
    if found is None:
        raise BadInput(f"{path}: buffer {name!r:.60} is not in the folder")
    return folder.read(found)

"""GLB, and .gltf whose buffers lie beside it (glTF 2.0 section 3.4: metres, y up)."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.gltf_extensions import refuse_extensions, way_out
from scenewright.stages.kit.formats.mesh_files import gltf_pixels, gltf_tree, meshes_of_glb, whole_number
from scenewright.stages.library.importing.gltf_plain import WRITTEN_OUT, PlainGltf
from scenewright.stages.library.importing.limits import MOST_TRIANGLES, MOST_VERTICES, SIMPLIFY
from scenewright.stages.library.importing.pictures import MOST_PIXELS
from scenewright.stages.library.importing.source_folder import LARGEST_FILE, SourceFolder
from scenewright.stages.library.importing.source_model import Declared, MeshContent
from scenewright.stages.library.importing.trimesh_surfaces import surface_of

Y_UP = (0.0, 1.0, 0.0)
PICTURES_NOT_READ = ("KHR_texture_basisu", "EXT_texture_avif")
"""Extensions whose pictures nothing here decodes; shapes do not depend on them."""


def read_gltf(folder: SourceFolder, path: Path) -> MeshContent:
    """Return the triangles of a glTF, where its nodes put them. Raises BadInput."""
    data = folder.read(path)
    with _told_as_broken(path):
        tree, binary = _packed(folder, path, data) if path.suffix.lower() == ".gltf" else _opened(data, path)
        refuse_extensions(tree, path.name, (*WRITTEN_OUT, *PICTURES_NOT_READ))
        binary, findings = _with_pictures_inside(folder, path, tree, binary)
        plain = PlainGltf(tree, binary)
        binary = plain.write_out()
        tree["extensionsRequired"] = [e for e in tree["extensionsRequired"] if e not in PICTURES_NOT_READ]
        findings += [f"{path.name}: {finding}" for finding in dict.fromkeys(plain.findings)]
        data = _glb(tree, [binary])
    if gltf_pixels(data, str(path), hint=SIMPLIFY) > MOST_PIXELS:
        _drop_pictures(tree)
        data = _glb(tree, [binary])
        findings.append(f"{path.name}: its pictures are too large, colours are those of the materials")
    meshes = meshes_of_glb(
        data,
        str(path),
        hint="look at it in a glTF validator",
        most_triangles=MOST_TRIANGLES,
        most_vertices=MOST_VERTICES,
    )
    surfaces = tuple(surface_of(mesh, str(mesh.metadata.get("name", ""))) for mesh in meshes)
    return MeshContent(surfaces, Declared(1.0, "format"), Declared(Y_UP, "format"), tuple(findings))


@contextmanager
def _told_as_broken(path: Path) -> Iterator[None]:
    try:
        yield
    except BadInput as error:
        message = error.message if error.message.startswith(str(path)) else f"{path}: {error.message}"
        raise BadInput(message, hint=error.hint) from None
    except KeyError as error:
        raise BadInput(f"{path}: glTF description is broken: {error} is missing"[:200]) from None
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
        raise BadInput(f"{path}: glTF description is broken: {type(error).__name__}: {error}"[:200]) from None


def _opened(data: bytes, path: Path) -> tuple[dict[str, Any], bytes]:
    """Return the description and the binary of a GLB. Raises BadInput."""
    if data[:4] != b"glTF" or len(data) < 20:
        raise BadInput(f"{path}: no GLB header")
    version, total, length = struct.unpack_from("<III", data, 4)
    if version != 2 or total != len(data) or 20 + length > total or data[16:20] != b"JSON":
        raise BadInput(
            f"{path}: GLB version {version} declares {total} bytes and {length} of JSON, the file has {len(data)}"
        )
    return gltf_tree(data[20 : 20 + length]), data[28 + length :]


def _packed(folder: SourceFolder, path: Path, data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the description of a .gltf with all its buffers as one. Raises BadInput."""
    tree = gltf_tree(data)
    refuse_extensions(tree, path.name, (*WRITTEN_OUT, *PICTURES_NOT_READ))
    chunks, starts, length = [], [], 0
    for buffer in tree.get("buffers", []):
        starts.append(length)
        part = _named(folder, path, str(buffer["uri"]), "buffer")[: whole_number(buffer["byteLength"])]
        chunks += [part, b"\0" * (-len(part) % 4)]
        length += len(part) + -len(part) % 4
        if length > LARGEST_FILE:
            raise BadInput(f"{path}: buffers of more than {LARGEST_FILE} bytes", hint=SIMPLIFY)
    for view in tree.get("bufferViews", []):
        view["byteOffset"] = whole_number(view.get("byteOffset", 0)) + starts[whole_number(view["buffer"])]
        view["buffer"] = 0
    tree["buffers"] = [{"byteLength": length}]
    return tree, b"".join(chunks)


def _with_pictures_inside(
    folder: SourceFolder, path: Path, tree: dict[str, Any], binary: bytes
) -> tuple[bytes, list[str]]:
    """Return the binary with the pictures that lie beside the file appended, and what is to be said of them."""
    used = [e for e in tree.get("extensionsRequired", ()) if e in PICTURES_NOT_READ]
    if used:
        _drop_pictures(tree)
        way = way_out(used[0], path.name)
        return binary, [f"{path.name}: pictures need {used[0]}, colours are those of the materials ({way} turns them)"]
    parts, length = [binary, b"\0" * (-len(binary) % 4)], len(binary) + -len(binary) % 4
    for image in tree.get("images", []):
        if "uri" not in image:
            continue
        try:
            data = _named(folder, path, str(image.pop("uri")), "picture")
        except BadInput as error:
            _drop_pictures(tree)
            return binary, [f"{error.message.removeprefix(f'{path.parent}/')}: colours are those of the materials"]
        tree.setdefault("bufferViews", []).append({"buffer": 0, "byteOffset": length, "byteLength": len(data)})
        image["bufferView"] = len(tree["bufferViews"]) - 1
        parts += [data, b"\0" * (-len(data) % 4)]
        length += len(data) + -len(data) % 4
        if length > LARGEST_FILE:
            raise BadInput(f"{path}: buffers and pictures of more than {LARGEST_FILE} bytes", hint=SIMPLIFY)
    return b"".join(parts), []


def _drop_pictures(tree: dict[str, Any]) -> bool:
    """Take pictures and what names them out of a glTF description; return whether there were any."""
    had = bool(tree.pop("images", None))
    tree.pop("textures", None)
    for material in tree.get("materials", []):
        for owner in (material, material.get("pbrMetallicRoughness", {})):
            for key in [key for key in owner if key.endswith("Texture")]:
                del owner[key]
    return had


def _glb(tree: dict[str, Any], chunks: list[bytes]) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    binary = sum(len(part) for part in chunks)
    head = struct.pack("<4sIII4s", b"glTF", 2, 12 + 8 + len(text) + 8 + binary, len(text), b"JSON")
    return b"".join([head, text, struct.pack("<I4s", binary, b"BIN\0"), *chunks])


def _named(folder: SourceFolder, path: Path, name: str, what: str) -> bytes:
    """Return the bytes of a buffer or picture by its URI. Raises BadInput."""
    if name.startswith("data:"):
        try:
            return base64.b64decode(name.partition(",")[2], validate=True)
        except ValueError:  # binascii.Error, or letters that are none of ASCII
            raise BadInput(f"{path}: a {what} is not base64") from None
    file = folder.find(name, path.parent) or folder.find(unquote(name), path.parent)
    if file is None:
        raise BadInput(f"{path}: {what} {name!r:.60} is not in the folder")
    return folder.read(file)

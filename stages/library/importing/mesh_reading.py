"""One mesh file of any format into painted surfaces, with the unit and the up axis that it declares."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mesh_files import mesh_of_bytes
from scenewright.stages.library.importing.collada_file import parse_collada
from scenewright.stages.library.importing.gltf_reading import Y_UP, read_gltf
from scenewright.stages.library.importing.limits import MOST_SHAPES, MOST_TRIANGLES, MOST_VERTICES, SIMPLIFY
from scenewright.stages.library.importing.obj_reading import read_obj
from scenewright.stages.library.importing.pictures import Pictures, face_colors
from scenewright.stages.library.importing.source_folder import LARGEST_TEXT, SourceFolder
from scenewright.stages.library.importing.source_model import Declared, MeshContent, Surface, painted_faces
from scenewright.stages.library.importing.trimesh_surfaces import surface_of

MESH_SUFFIXES = (".obj", ".stl", ".dae", ".glb", ".gltf", ".ply")
MOST_KEPT_FILES = 1000
"""Most mesh files that are kept in memory; by eye."""


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
        content = read_obj(folder, path)
    elif kind in (".glb", ".gltf"):
        content = read_gltf(folder, path)
    elif kind in (".stl", ".ply"):
        mesh = mesh_of_bytes(
            folder.read(path),
            kind,
            str(path),
            hint="see whether the file is whole",
            most_triangles=MOST_TRIANGLES,
            most_vertices=MOST_VERTICES,
        )
        content = MeshContent((surface_of(mesh, path.stem),), Declared(None, "assumed"), Declared(None, "assumed"))
    else:
        raise BadInput(f"{path}: not a mesh format that is read", hint=f"known: {', '.join(MESH_SUFFIXES)}")
    if content.triangles == 0:
        raise BadInput(f"{path}: holds no triangles")
    if content.triangles > MOST_TRIANGLES or len(content.surfaces) > MOST_SHAPES:
        raise BadInput(f"{path}: {content.triangles} triangles in {len(content.surfaces)} pieces", hint=SIMPLIFY)
    if any(not np.isfinite(surface.vertices).all() for surface in content.surfaces):
        raise BadInput(f"{path}: vertices are not finite")
    return content


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

"""Geoms of MJCF as painted surfaces: primitives of MuJoCo's sizes, mesh files, meshes written in the file."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.solids import Solid, box, cylinder, hull
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.library.importing.limits import MOST_TRIANGLES, MOST_VERTICES, Allowance, one_color
from scenewright.stages.library.importing.mesh_reading import read_mesh_file
from scenewright.stages.library.importing.mjcf_document import MAIN, Attributes, MjcfDocument, Placed
from scenewright.stages.library.importing.mjcf_poses import turn_of, unit_vector, z_towards
from scenewright.stages.library.importing.primitives import ball, capsule
from scenewright.stages.library.importing.source_folder import list_of_numbers, long_row, numbers
from scenewright.stages.library.importing.source_model import Surface, painted_faces, solid_surface

FIRST_HIDDEN_GROUP = 3
"""Geoms of groups 0 to 2 are drawn by default, those of 3 and up are not."""


@dataclass(frozen=True)
class Gathered:
    """What the shapes of one model are counted in, and what is said of them."""

    allowances: tuple[Allowance, ...]
    findings: list[str]

    def take(self, surfaces: list[Surface]) -> list[Surface]:
        """Count surfaces and return them. Raises BadInput for too many."""
        for allowance in self.allowances:
            allowance.take(surfaces)
        return surfaces


def is_drawn(attributes: Attributes, where: str) -> bool:
    """Whether viewers draw a geom. Raises BadInput, beginning with `where`."""
    return float(numbers(attributes.get("group", "0"), 1, f"{where}: group")[0]) < FIRST_HIDDEN_GROUP


def collides(attributes: Attributes) -> bool:
    """Whether anything can touch a geom."""
    return attributes.get("contype", "1") != "0" or attributes.get("conaffinity", "1") != "0"


def geom_surfaces(geom: Placed, attributes: Attributes, by: Gathered, where: str) -> list[Surface]:
    """Return the surfaces of a geom in its body's frame. Raises BadInput, beginning with `where`."""
    name = attributes.get("name", "")
    color = _color(geom.document, attributes, where, by.findings)
    if "mesh" in attributes:
        return _mesh(geom, attributes, color, by, where)
    kind = attributes.get("type", "sphere")
    size = list_of_numbers(attributes.get("size", ""), f"{where}: size")
    pose, length = geom.pose(attributes, where), None
    if "fromto" in attributes and kind in ("capsule", "cylinder", "box", "ellipsoid"):
        ends = numbers(attributes["fromto"], 6, f"{where}: fromto")
        direction = ends[:3] - ends[3:]
        length = float(np.linalg.norm(direction)) / 2
        turn = z_towards(unit_vector(direction, where))
        pose = geom.parent_from_frame @ transform_from(turn, (ends[:3] + ends[3:]) / 2)
    solid = _primitive(kind, size, length, where)
    if solid is None:
        by.findings.append(f"geoms of type {kind!r:.20} are left out")
        return []
    return by.take([solid_surface(solid, color, name).moved(pose)])


def _color(
    document: MjcfDocument, attributes: Attributes, where: str, findings: list[str]
) -> tuple[float, float, float] | None:
    text = attributes.get("rgba")
    material = document.assets["material"].get(attributes.get("material", ""))
    if material is not None:
        plain = document.attributes(material, MAIN).get("rgba", "1 1 1 1")
        if material.get("texture") or material.find("layer") is not None:
            findings.append(one_color("texture of material", attributes["material"]))
            if plain == "1 1 1 1":
                plain = "0.7 0.7 0.7 1"  # a picture on it that is not looked at
        text = plain if text is None else text
    if text is None:
        return None
    red, green, blue, _ = numbers(text, 4, f"{where}: rgba")
    return (float(red), float(green), float(blue))


def _mesh(
    geom: Placed, attributes: Attributes, color: tuple[float, float, float] | None, by: Gathered, where: str
) -> list[Surface]:
    document, name, label = geom.document, attributes["mesh"], attributes.get("name", "")
    kind = attributes.get("type", "sphere")
    if kind not in ("mesh", "sdf"):
        by.findings.append(f"a {kind:.20} is fitted to mesh {name!r:.40} (type, mesh): the mesh itself is taken")
    element = document.assets["mesh"].get(name)
    if element is None:
        raise BadInput(f"{where}: mesh {name!r:.60} is not declared")
    mesh = document.attributes(element, MAIN)
    scale = np.diag([*numbers(mesh.get("scale", "1 1 1"), 3, f"{where}: mesh scale"), 1.0])
    shift = np.eye(4)
    if "refpos" in mesh or "refquat" in mesh:
        reference = transform_from(
            turn_of(mesh.get("refquat", "1 0 0 0"), f"{where}: refquat"), numbers(mesh.get("refpos", "0 0 0"), 3, where)
        )
        shift = np.linalg.inv(reference)
    if "file" in mesh:
        surfaces = [replace(s, mesh_origin=np.zeros(3)) for s in _file_surfaces(document, mesh["file"])]
    elif "vertex" in mesh:
        surfaces = [_written_mesh(mesh, where)]
    else:
        by.findings.append(f"mesh {name!r:.40} has neither file nor vertices (builtin=): left out")
        return []
    pose = geom.pose(attributes, where) @ shift @ scale
    moved = []
    for surface in surfaces:
        colors = surface.colors if color is None else painted_faces(len(surface.faces), color)
        named = replace(surface, colors=colors, name=f"{label} {name} {surface.name}".strip())
        moved.append(named.moved(pose))
    return by.take(moved)


def _file_surfaces(document: MjcfDocument, file: str) -> tuple[Surface, ...]:
    shelf = document.compiler.get("meshdir") or document.compiler.get("assetdir") or ""
    path = document.folder.find(f"{shelf}/{file}" if shelf else file, document.path.parent)
    path = path or document.folder.find(file, document.path.parent)
    if path is None:
        raise BadInput(f"{document.path}: mesh {file!r:.100} is not in the folder", hint="copy it there")
    return read_mesh_file(document.folder, path).surfaces


def _written_mesh(mesh: Attributes, where: str) -> Surface:
    """Return a mesh whose vertices stand in the file; without faces it is their convex hull."""
    points = long_row(mesh["vertex"], np.float64, 3 * MOST_VERTICES, f"{where}: mesh vertex")
    faces = long_row(mesh.get("face", ""), np.int64, 3 * MOST_TRIANGLES, f"{where}: mesh face")
    if not np.isfinite(points).all():
        raise BadInput(f"{where}: vertices of a mesh are not finite")
    if len(points) < 12 or len(points) % 3 or len(faces) % 3:
        raise BadInput(f"{where}: vertices or faces of a mesh are no multiple of 3 numbers, or fewer than 4 points")
    points = points.reshape(-1, 3)
    if not len(faces):
        return solid_surface(hull(points), None)
    if faces.min() < 0 or faces.max() >= len(points):
        raise BadInput(f"{where}: a face names a vertex outside of 0..{len(points) - 1}")
    triangles = faces.reshape(-1, 3)
    return Surface(points, triangles, painted_faces(len(triangles), None))


def _primitive(kind: str, size: np.ndarray, half_length: float | None, where: str) -> Solid | None:
    """Return a geom of MuJoCo's sizes (half lengths) as a solid along z, None for one that is left out."""
    needed = {"box": 3, "ellipsoid": 3, "sphere": 1, "capsule": 2, "cylinder": 2}.get(kind)
    if needed is None:
        return None
    if half_length is not None:
        size = np.array([size[0], half_length] if needed == 2 else [*size[:2], half_length]) if len(size) else size
    if len(size) < needed or not (size[:needed].min() > 0 and size[:needed].max() < 1e6):
        raise BadInput(f"{where}: a {kind} without size")
    if kind == "box":
        x, y, z = (float(v) for v in size[:3])
        return box((-x, x), (-y, y), (-z, z))
    if kind == "cylinder":
        return cylinder(float(size[0]), (-float(size[1]), float(size[1])), count=24)
    if kind == "capsule":
        return capsule(float(size[0]), float(size[1]))
    return ball(size[:3] if kind == "ellipsoid" else np.full(3, size[0]))

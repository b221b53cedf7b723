"""The shapes of a URDF's links as trimesh meshes: collision shapes for geometry, visual ones for pictures."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scipy.spatial.transform import Rotation


def _numbers(text: str | None, default: str) -> list[float]:
    return [float(value) for value in (text or default).split()]


def _placement(element: ElementTree.Element) -> np.ndarray:
    pose = np.eye(4)
    origin = element.find("origin")
    if origin is not None:
        pose[:3, 3] = _numbers(origin.get("xyz"), "0 0 0")
        pose[:3, :3] = Rotation.from_euler("xyz", _numbers(origin.get("rpy"), "0 0 0")).as_matrix()
    return pose


def _around(mesh: trimesh.Trimesh, axes: list[int]) -> trimesh.Trimesh:
    """Return the mesh widened along axes so that its faces touch the round shape that its vertices lay on."""
    distances = np.einsum("ij,ij->i", mesh.triangles[:, 0], mesh.face_normals)
    sides = np.abs(mesh.face_normals[:, axes]).sum(axis=1) > 0.5
    radius = float(np.linalg.norm(mesh.vertices[:, axes], axis=1).max())
    scale = np.ones(3)
    scale[axes] = radius / float(distances[sides].min())
    mesh.apply_scale(scale)
    return mesh


def _mesh_of(geometry: ElementTree.Element, around: bool = False) -> trimesh.Trimesh:
    shape = geometry[0]
    if shape.tag == "box":
        return trimesh.creation.box(extents=_numbers(shape.get("size"), "1 1 1"))
    if shape.tag == "cylinder":
        mesh = trimesh.creation.cylinder(
            radius=float(shape.get("radius", 1)), height=float(shape.get("length", 1)), sections=32
        )
        return _around(mesh, [0, 1]) if around else mesh
    if shape.tag == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=float(shape.get("radius", 1)))
        return _around(mesh, [0, 1, 2]) if around else mesh
    if shape.tag == "mesh":
        mesh = read_mesh(Path(shape.get("filename", "")), hint="make the scene again")
        mesh.apply_scale(_numbers(shape.get("scale"), "1 1 1"))
        return mesh
    raise BadInput(f"URDF geometry <{shape.tag}> is not known", hint="box, cylinder, sphere and mesh are")


def link_shapes(
    text: str, tag: Literal["collision", "visual"] = "collision", *, around: bool = False
) -> dict[str, list[trimesh.Trimesh]]:
    """Return the shapes of each link of URDF text (absolute mesh paths), link frame, metres. Raises BadInput.

    A URDF <material> colour is applied to shapes that have no colours of their own. The facets of round shapes lie
    inside them, with `around` outside.
    """
    root = ElementTree.fromstring(text)
    colors = {
        material.get("name"): color.get("rgba")
        for material in root.iter("material")
        if (color := material.find("color")) is not None
    }
    shapes: dict[str, list[trimesh.Trimesh]] = {}
    for link in root.findall("link"):
        entries = shapes.setdefault(link.get("name", ""), [])
        for element in link.findall(tag):
            geometry = element.find("geometry")
            if geometry is None or len(geometry) == 0:
                continue
            mesh = _mesh_of(geometry, around)
            mesh.apply_transform(_placement(element))
            material = element.find("material")
            rgba = None if material is None else colors.get(material.get("name"))
            if rgba is not None and not has_colors(mesh):
                paint(mesh, np.round(255 * np.array(_numbers(rgba, "1 1 1 1"))).astype(np.uint8))
            entries.append(mesh)
    return shapes


def has_colors(mesh: trimesh.Trimesh) -> bool:
    """Whether a mesh has face, vertex or texture colours of its own."""
    return getattr(mesh.visual, "kind", None) is not None


def paint(mesh: trimesh.Trimesh, rgba: np.ndarray) -> None:
    """Give all faces of a mesh one colour (4,) uint8."""
    mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=np.tile(rgba, (len(mesh.faces), 1)))


def joined(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return one mesh of the vertices and faces of several, without colours."""
    plain = [trimesh.Trimesh(part.vertices, part.faces, process=False) for part in meshes]
    mesh = trimesh.util.concatenate(plain)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def body_surface(text: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (count, 3) points around a rigid body of URDF text, its frame [m], and their normals; always the same."""
    meshes = [mesh for entries in link_shapes(text).values() for mesh in entries]
    return surface_points(meshes, count, np.random.default_rng(0))


def surface_points(
    meshes: list[trimesh.Trimesh], count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return (count, 3) points drawn uniformly from the surfaces of meshes of one frame [m], and their normals."""
    mesh = joined(meshes)
    weights = mesh.area_faces / mesh.area_faces.sum()
    faces = random.choice(len(mesh.faces), size=count, p=weights)
    u, v = random.random((2, count))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    corners = mesh.triangles[faces]
    points = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
    return points, np.asarray(mesh.face_normals)[faces]

"""Many coloured meshes as one list of triangles with smooth corner normals: what the ray caster and shader read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.geometry.cells import row_keys
from scenewright.stages.kit.rendering.patterns import Material, is_wood

CREASE_COSINE = float(np.cos(np.deg2rad(40.0)))
"""Faces that meet at a sharper angle keep a hard edge."""


@dataclass(frozen=True)
class TriangleSoup:
    """T triangles with everything that shading needs; all arrays are indexed by the global triangle number."""

    corners: np.ndarray
    """(T, 3, 3) float32, world frame [m]."""
    face_normals: np.ndarray
    """(T, 3) float32, unit."""
    corner_normals: np.ndarray
    """(T, 3, 3) float32, unit; smooth across edges blunter than the crease angle."""
    corner_colors: np.ndarray
    """(T, 3, 3) float32, linear RGB in 0..1."""
    instance: np.ndarray
    """(T,) int32."""
    material: np.ndarray
    """(T,) int32, row in the material table."""
    material_table: np.ndarray
    """(M, K) float32, see patterns.material_table."""

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return len(self.corners)


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """Convert sRGB in 0..1 (any shape) to linear light (IEC 61966-2-1)."""
    srgb = np.asarray(srgb, dtype=np.float32)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


def linear_to_srgb(linear: np.ndarray) -> np.ndarray:
    """Convert linear light in 0..1 (any shape) to sRGB in 0..1 (IEC 61966-2-1)."""
    linear = np.clip(np.asarray(linear, dtype=np.float32), 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055).astype(np.float32)


def _corner_colors(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return (F, 3, 3) sRGB in 0..1 from face, vertex or texture colours; grey where there are none."""
    visual: Any = mesh.visual
    if visual.kind == "texture":
        visual = visual.to_color()
    if visual.kind == "face":
        return np.repeat(np.asarray(visual.face_colors, dtype=np.float32)[:, None, :3] / 255.0, 3, axis=1)
    if visual.kind == "vertex":
        return np.asarray(visual.vertex_colors, dtype=np.float32)[:, :3][mesh.faces] / np.float32(255.0)
    return np.full((len(mesh.faces), 3, 3), 0.7, dtype=np.float32)


@compiled
def _smooth_normals(
    vertex_of_corner: np.ndarray,
    start: np.ndarray,
    faces_of_vertex: np.ndarray,
    normals: np.ndarray,
    areas: np.ndarray,
    crease_cosine: float,
) -> np.ndarray:
    faces = vertex_of_corner.shape[0]
    result = np.zeros((faces, 3, 3), dtype=np.float32)
    for face in range(faces):
        for corner in range(3):
            vertex = vertex_of_corner[face, corner]
            x, y, z = 0.0, 0.0, 0.0
            for k in range(start[vertex], start[vertex + 1]):
                other_face = faces_of_vertex[k]
                cosine = (
                    normals[face, 0] * normals[other_face, 0]
                    + normals[face, 1] * normals[other_face, 1]
                    + normals[face, 2] * normals[other_face, 2]
                )
                if cosine > crease_cosine:
                    x += areas[other_face] * normals[other_face, 0]
                    y += areas[other_face] * normals[other_face, 1]
                    z += areas[other_face] * normals[other_face, 2]
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                result[face, corner, 0] = x / length
                result[face, corner, 1] = y / length
                result[face, corner, 2] = z / length
            else:
                for axis in range(3):
                    result[face, corner, axis] = normals[face, axis]
    return result


def corner_normals(corners: np.ndarray, normals: np.ndarray, crease_cosine: float = CREASE_COSINE) -> np.ndarray:
    """Return unit normals (F, 3, 3) per triangle corner: area-weighted means over the faces that share the corner's
    position (to 10 um) and are bent by less than the crease angle.

    `corners` (F, 3, 3) [m], `normals` (F, 3) unit face normals.
    """
    faces = len(corners)
    keys = row_keys(np.round(corners.reshape(-1, 3) * 1e5).astype(np.int64))
    order = np.argsort(keys, kind="stable")
    begins = np.diff(keys[order], prepend=keys[order[0]] - 1) != 0
    vertex = np.empty(len(keys), dtype=np.int64)
    vertex[order] = np.cumsum(begins) - 1
    start = np.append(np.flatnonzero(begins), len(keys))
    edge = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(edge, axis=1)
    return _smooth_normals(vertex.reshape(faces, 3), start, order // 3, normals, areas, crease_cosine)


def build_soup(
    meshes: Sequence[tuple[int, trimesh.Trimesh]], materials: dict[int, Material] | None = None
) -> TriangleSoup:
    """Join `(instance id, mesh in the world frame)` pairs into one soup; degenerate triangles are dropped.

    `materials` maps instance ids to materials; instances that are not named are plain and matt. Raises BadInput when
    there is no triangle at all.
    """
    materials = materials or {}
    table = [Material()]
    arrays_of_meshes: list[tuple[np.ndarray, ...]] = []
    for instance, mesh in meshes:
        corners = np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces]
        edge = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(edge, axis=1)
        keep = length > 1e-12
        if not keep.any():
            continue
        corners = corners[keep]
        normals = edge[keep] / length[keep, None]
        srgb = _corner_colors(mesh)[keep]
        rows = np.zeros(len(corners), dtype=np.int32)
        if instance in materials:
            material = materials[instance]
            rows[:] = len(table)
            table.append(material)
            if material.only_wood:
                rows[~is_wood(srgb.mean(axis=1))] = len(table)
                table.append(replace(material, pattern="plain"))
        arrays_of_meshes.append(
            (
                corners.astype(np.float32),
                normals.astype(np.float32),
                corner_normals(corners, normals),
                srgb_to_linear(srgb),
                np.full(len(corners), instance, dtype=np.int32),
                rows,
            )
        )
    if not arrays_of_meshes:
        raise BadInput("nothing to render: the meshes hold no triangle with an area")
    joined = [np.concatenate(columns) for columns in zip(*arrays_of_meshes, strict=True)]
    corners, normals, smooth, colors, instances, rows = joined
    rows_of_table = np.stack([material.row() for material in table])
    return TriangleSoup(corners, normals, smooth, colors, instances, rows, rows_of_table)


def moved_soup(soup: TriangleSoup, pose: np.ndarray) -> TriangleSoup:
    """Return the triangles under a rigid motion (4, 4)."""
    turn = pose[:3, :3].T.astype(np.float32)
    return replace(
        soup,
        corners=soup.corners @ turn + pose[:3, 3].astype(np.float32),
        face_normals=soup.face_normals @ turn,
        corner_normals=soup.corner_normals @ turn,
    )


def joined_soups(soups: Sequence[TriangleSoup]) -> TriangleSoup:
    """Return the triangles of several soups without materials, at least one, as one."""
    names = ("corners", "face_normals", "corner_normals", "corner_colors", "instance", "material")
    columns = {name: np.concatenate([getattr(soup, name) for soup in soups]) for name in names}
    return TriangleSoup(**columns, material_table=soups[0].material_table)

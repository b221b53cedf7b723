"""Give the parts of one body the colours that the map shows there, not those of its CAD model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.model_writer import write_obj
from scenewright.stages.kit.formats.urdf_file import Shape


def recolored(colors: np.ndarray, weights: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Return colours (K, 3) whose mean under `weights` (K,) is `mean` (3,), all sRGB in 0..1.

    What sets them apart from each other stays, but is shrunk by one factor when a colour would leave 0..1.
    """
    colors, mean = np.asarray(colors, dtype=float), np.clip(np.asarray(mean, dtype=float), 0.0, 1.0)
    weights = np.asarray(weights, dtype=float)
    if weights.sum() <= 0:
        weights = np.ones(len(colors))
    apart = colors - weights @ colors / weights.sum()
    with np.errstate(all="ignore"):  # a difference of nothing has all the room
        room = np.where(apart > 0, (1.0 - mean) / apart, np.where(apart < 0, -mean / apart, np.inf))
    return np.asarray(np.clip(mean + min(1.0, float(room.min())) * apart, 0.0, 1.0))


def recolored_shapes(root: Path, body: str, shapes: Sequence[Shape], color: tuple[int, int, int]) -> tuple[Shape, ...]:
    """Return the visual shapes of one part with their mean colour, weighted by surface, set to `color` (sRGB, 0..255).

    Mesh files that hold colours themselves are written anew under `root`/meshes/`body`/; the others are shared with the
    other bodies of the model and get their colour from the URDF.
    """
    meshes = [None if shape.mesh is None else read_mesh(root / shape.mesh) for shape in shapes]
    painted, areas, counts = [], [], []
    for shape, mesh in zip(shapes, meshes, strict=True):
        mesh_colors = None if mesh is None else vertex_colors(mesh)
        if mesh_colors is not None and mesh is not None:
            share = np.zeros(len(mesh.vertices))  # each corner of a triangle stands for a third of it
            np.add.at(share, np.asarray(mesh.faces), np.repeat(mesh.area_faces[:, None] / 3.0, 3, axis=1))
            painted.append(mesh_colors / 255.0)
            areas.append(share * shape.scale**2)
        else:
            painted.append(np.array([(shape.color or (0.6, 0.6, 0.6, 1.0))[:3]]))
            areas.append(np.array([_area(shape, mesh)]))
        counts.append(len(painted[-1]))
    if not painted:
        return tuple(shapes)
    values = recolored(np.concatenate(painted), np.concatenate(areas), np.array(color) / 255.0)
    result = []
    for shape, mesh, mesh_colors, area in zip(
        shapes, meshes, np.split(values, np.cumsum(counts)[:-1]), areas, strict=True
    ):
        red, green, blue = (float(v) for v in np.average(mesh_colors, axis=0, weights=area if area.sum() > 0 else None))
        alpha = 1.0 if shape.color is None else shape.color[3]
        name = shape.mesh
        if mesh is not None and name is not None and len(mesh_colors) == len(mesh.vertices) > 1:
            name = f"meshes/{body}/{Path(name).parent.name}_{Path(name).name}"
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            write_obj(root / name, mesh.vertices, mesh.faces, np.round(255.0 * mesh_colors))
        result.append(replace(shape, mesh=name, color=(red, green, blue, alpha)))
    return tuple(result)


def vertex_colors(mesh: trimesh.Trimesh) -> np.ndarray | None:
    """Return vertex colours (V, 3) uint8, or None for a mesh without any."""
    visual = mesh.visual
    if not isinstance(visual, trimesh.visual.ColorVisuals) or visual.kind not in ("vertex", "face"):
        return None
    return np.asarray(visual.vertex_colors)[:, :3]


def _area(shape: Shape, mesh: trimesh.Trimesh | None) -> float:
    """Return the surface of a shape [m^2]."""
    if shape.box_size is not None:
        x, y, z = shape.box_size
        return 2 * (x * y + y * z + z * x)
    return 0.0 if mesh is None else float(mesh.area) * shape.scale**2

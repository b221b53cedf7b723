"""How much of what was seen the scene explains: surface that lies near the model or the mesh that stands for it.

A model that fits explains what cameras saw of its thing; one that only has its size does not. What neither a model nor
a mesh, layout or surroundings explains is kept apart (`unexplained.ply`), so that a scene says what it lacks.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scenewright.schemas.cad_scene import Explained
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.cad.carcasses import Patches
from scenewright.stages.cad.model_surfaces import ModelSurface, to_model, to_world
from scenewright.stages.cad.nearest_triangles import nearest_triangles, tree_of
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.cad.surroundings import compact
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.transforms import apply

NEAR = 0.02
"""Surface that lies so near to a model, and by as much more as depth spreads, is explained by it [m]."""
LARGE, FLAT, ALIKE = 0.05, 0.05, 0.9
"""Depth spreads about planes of at least so much surface [m²]: points so near [m], of normals whose cosine is this."""
ROUGHLY_NORMAL = 1.4826
"""Standard deviation of normally distributed values by the median of their magnitudes."""
POINTS_OF_PLANE = 2000
"""Most points that are looked at of a plane."""
Triangles = tuple[np.ndarray, np.ndarray]
"""Vertices (V, 3) and faces (F, 3), world frame."""


def depth_spread(planes: Iterable[tuple[SurfacePlane, Patches]]) -> float:
    """Return how far surface lies from planes that were found in it: robust standard deviation [m], the median of the
    planes; 0 without any. Each plane comes with the surface of its thing, world frame."""
    spreads = []
    for plane, patches in planes:
        normal = np.asarray(plane.normal)
        height = patches.points @ normal + plane.offset
        on_plane = (np.abs(height) < FLAT) & (patches.normals @ normal > ALIKE)
        if patches.areas[on_plane].sum() >= LARGE:
            heights = height[on_plane][:: max(1, np.count_nonzero(on_plane) // POINTS_OF_PLANE)]
            spreads.append(ROUGHLY_NORMAL * float(np.median(np.abs(heights - np.median(heights)))))
    return float(np.median(spreads)) if spreads else 0.0


def explained_by_model(surface: ModelSurface, placement: Placement, patches: Patches, within: float) -> Explained:
    """Return the share of a surface that lies within some distance [m] of a placed model."""
    nearest = surface.closest(to_model(placement, patches.points), placement.shape.joints)
    share = _share(placement.scale * nearest.distance < within, patches.areas)
    return Explained(area=_area(patches), by_model=share, by_mesh=0.0)


def explained_by_mesh(patches: Patches, mesh: EntityMesh, shift: np.ndarray, within: float) -> Explained:
    """Return the share of a surface that lies within some distance [m] of its own mesh, which went by `shift` (3,)."""
    share = 1.0
    if np.linalg.norm(shift) >= within and len(mesh.faces):
        share = _share(distances(patches.points, [(mesh.vertices + shift, mesh.faces)]) < within, patches.areas)
    return Explained(area=_area(patches), by_model=0.0, by_mesh=share)


def placed_triangles(surface: ModelSurface, placement: Placement) -> list[Triangles]:
    """Return the triangles of a placed model, a part each."""
    poses = part_transforms(surface.model, placement.shape.joints)
    return [
        (to_world(placement, apply(poses[part], vertices)), faces) for part, (vertices, faces) in surface.meshes.items()
    ]


def unexplained(mesh: EntityMesh, stands: Sequence[Triangles], within: float) -> EntityMesh | None:
    """Return the surface of the map whose triangles' middles are farther than some distance [m] from all that stands
    in the scene; None where there is none."""
    if len(mesh.faces) == 0:
        return None
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    faces = mesh.faces[distances(middles, stands) >= within]
    if len(faces) == 0:
        return None
    return compact(mesh, faces)


def distances(points: np.ndarray, stands: Sequence[Triangles]) -> np.ndarray:
    """Return how far points (N, 3) are from triangles (N,) [m]; infinite without any."""
    kept = [(vertices, faces) for vertices, faces in stands if len(faces)]
    if not kept or len(points) == 0:
        return np.full(len(points), np.inf)
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in kept)])
    vertices = np.concatenate([vertices for vertices, _ in kept])
    faces = np.concatenate([faces.astype(np.int64) + first for (_, faces), first in zip(kept, firsts, strict=False)])
    return nearest_triangles(tree_of(vertices, faces), points).distance


def shares_of(explained: Mapping[str, Explained]) -> dict[str, float]:
    """Return the shares of the surface of all things that models and meshes explain, by area."""
    total = sum(entry.area for entry in explained.values())
    if total <= 0:
        return {"explained_by_model": 0.0, "explained_by_mesh": 0.0}
    by_model = sum(entry.area * entry.by_model for entry in explained.values()) / total
    by_mesh = sum(entry.area * entry.by_mesh for entry in explained.values()) / total
    return {"explained_by_model": round(by_model, 4), "explained_by_mesh": round(by_mesh, 4)}


def _area(patches: Patches) -> float:
    return round(float(patches.areas.sum()), 4)


def _share(chosen: np.ndarray, areas: np.ndarray) -> float:
    total = float(areas.sum())
    return round(float(areas[chosen].sum()) / total, 4) if total > 0 else 0.0

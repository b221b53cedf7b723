"""Panoptic maps made by hand: entities from meshes, whole or as a camera above would see them."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import trimesh
from scenewright.stages.kit.geometry.point_clouds import sample_large_triangles, thin_to_grid

from benchmarks.perfect_maps import perfect_map, tiles, write_map

__all__ = [
    "box_mesh",
    "chair_mesh",
    "floor_mesh",
    "perfect_map",
    "placed",
    "seen_surface",
    "table_mesh",
    "tiles",
    "write_map",
]


def box_mesh(low, high) -> trimesh.Trimesh:
    """An axis-aligned box between two corners."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    return trimesh.creation.box(
        extents=high - low, transform=trimesh.transformations.translation_matrix((low + high) / 2)
    )


def table_mesh(center=(0.0, 0.0), size=(1.2, 0.7, 0.75), yaw=0.0, base=0.0) -> trimesh.Trimesh:
    """A table: 4 cm top and four legs."""
    x, y, z = size
    parts = [box_mesh((-x / 2, -y / 2, z - 0.04), (x / 2, y / 2, z))]
    for sx in (-1, 1):
        for sy in (-1, 1):
            cx, cy = sx * (x / 2 - 0.04), sy * (y / 2 - 0.04)
            parts.append(box_mesh((cx - 0.025, cy - 0.025, 0), (cx + 0.025, cy + 0.025, z - 0.04)))
    return placed(trimesh.util.concatenate(parts), (*center, base), yaw)


def chair_mesh(center=(0.0, 0.0), yaw=0.0) -> trimesh.Trimesh:
    """A chair: seat at 0.45 m, back to 0.9 m, four legs; looks along -y."""
    parts = [box_mesh((-0.22, -0.22, 0.42), (0.22, 0.22, 0.45)), box_mesh((-0.22, 0.19, 0.45), (0.22, 0.22, 0.9))]
    for sx in (-1, 1):
        for sy in (-1, 1):
            parts.append(box_mesh((sx * 0.2 - 0.02, sy * 0.2 - 0.02, 0), (sx * 0.2 + 0.02, sy * 0.2 + 0.02, 0.42)))
    return placed(trimesh.util.concatenate(parts), (*center, 0.0), yaw)


def placed(mesh: trimesh.Trimesh, translation, yaw: float = 0.0) -> trimesh.Trimesh:
    """A copy, turned about z and then shifted."""
    copy = mesh.copy()
    copy.apply_transform(trimesh.transformations.rotation_matrix(yaw, [0, 0, 1]))
    copy.apply_translation(translation)
    return copy


def floor_mesh(low=(-1.2, -1.2), high=(1.2, 1.2), z=0.0) -> trimesh.Trimesh:
    """A floor that looks up."""
    vertices = [[low[0], low[1], z], [high[0], low[1], z], [high[0], high[1], z], [low[0], high[1], z]]
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], process=False)


def seen_surface(
    meshes: dict[int, trimesh.Trimesh],
    eyes: list[tuple[float, float, float]],
    *,
    noise: float = 0.0,
    spacing: float = 0.013,
    seed: int = 0,
) -> dict[int, trimesh.Trimesh]:
    """What cameras at `eyes` would see of each mesh, as tiles: points that face an eye with nothing in between."""
    scene = o3d.t.geometry.RaycastingScene()
    for mesh in meshes.values():
        scene.add_triangles(
            o3d.core.Tensor(np.asarray(mesh.vertices, dtype=np.float32)),
            o3d.core.Tensor(np.asarray(mesh.faces, dtype=np.uint32)),
        )
    result = {}
    for instance, mesh in meshes.items():
        random = np.random.default_rng([seed, instance])
        points, normals = sample_large_triangles(
            np.asarray(mesh.vertices), np.asarray(mesh.faces), 0.5 * spacing, random
        )
        points, normals = thin_to_grid(points, normals, spacing)
        seen = np.zeros(len(points), dtype=bool)
        for eye in eyes:
            ray = points - np.asarray(eye)
            distance = np.linalg.norm(ray, axis=1)
            direction = ray / distance[:, None]
            facing = np.einsum("ij,ij->i", direction, normals) < -0.1
            rays = np.concatenate([np.tile(eye, (len(points), 1)), direction], axis=1).astype(np.float32)
            hit = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
            seen |= facing & (hit > distance - 0.004)
        points = points[seen] + noise * random.normal(size=(np.count_nonzero(seen), 1)) * normals[seen]
        result[instance] = tiles(points, normals[seen], 0.9 * spacing)
    return result

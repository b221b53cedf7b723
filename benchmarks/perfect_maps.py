"""Maps without a mapper: made of given surfaces, or of the true surface that the camera saw of a generated room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import EntitiesFile, Entity, PanopticMap
from scenewright.schemas.vocabulary import load_vocabulary

TILE = 0.009
"""Edge of the squares that stand for points a centimetre apart [m]."""


def tiles(
    points: np.ndarray, normals: np.ndarray, edge: float = TILE, colors: np.ndarray | None = None
) -> trimesh.Trimesh:
    """Return a mesh of one little square of `edge` [m] for each point (N, 3) with normal (N, 3), of its colour (N, 3)
    uint8 where given."""
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    corners = [-first - second, first - second, first + second, -first + second]
    vertices = np.stack([points + 0.5 * edge * corner for corner in corners], axis=1).reshape(-1, 3)
    base = 4 * np.arange(len(points))[:, None]
    faces = np.concatenate([base + [0, 1, 2], base + [0, 2, 3]])
    painted = None if colors is None else np.repeat(colors, 4, axis=0)
    return trimesh.Trimesh(vertices, faces, vertex_colors=painted, process=False)


def write_map(root: Path, meshes: dict[int, trimesh.Trimesh], classes: dict[int, str]) -> PanopticMap:
    """Write a panoptic map artifact (without volume and counts) of the given entity meshes: instance -> mesh, class."""
    root = Path(root)
    (root / "entities").mkdir(parents=True, exist_ok=True)
    entities = []
    for instance, mesh in sorted(meshes.items()):
        name = f"entities/{instance}.ply"
        mesh.export(root / name)
        entities.append(
            Entity(
                instance=instance,
                class_name=classes[instance],
                mesh=name,
                vertices=len(mesh.vertices),
                triangles=len(mesh.faces),
                box_minimum=tuple(mesh.vertices.min(axis=0)) if len(mesh.vertices) else (0, 0, 0),
                box_maximum=tuple(mesh.vertices.max(axis=0)) if len(mesh.vertices) else (0, 0, 0),
                confidence=1.0,
                observations=10,
                segments=(instance,),
            )
        )
    whole = [mesh for _, mesh in sorted(meshes.items())]
    if whole:
        merged = trimesh.util.concatenate(whole)
        merged.export(root / "mesh.ply")
        vocabulary = load_vocabulary()
        owner = np.concatenate([np.full(len(m.vertices), k, dtype=np.int32) for k, m in sorted(meshes.items())])
        class_id = np.array([vocabulary.by_name(classes[k]).id for k in owner], dtype=np.int32)
        np.savez(root / "mesh_labels.npz", instance=owner, segment=owner, class_id=class_id)
    EntitiesFile(
        voxel_size=0.01,
        truncation_distance=0.04,
        frames_integrated=10,
        segmentation="made by hand",
        entities=tuple(entities),
    ).write(root / "entities.json")
    return PanopticMap(root)


def perfect_map(truth: GroundTruth, root: Path) -> PanopticMap:
    """Write the map that a perfect reconstruction of what was seen would give: true surface points with true labels.

    Points come from visible.npz, their normals and colours from the nearest triangle of mesh.ply; of floor, walls and
    ceiling every fourth or so, in tiles as much larger.
    """
    with np.load(truth.path("visible.npz"), allow_pickle=False) as archive:
        points, instance = archive["points"].astype(float), archive["instance"]
    mesh = trimesh.load_mesh(truth.path("mesh.ply"), process=False)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(np.asarray(mesh.vertices, dtype=np.float32)),  # type: ignore[call-overload]
        o3d.core.Tensor(np.asarray(mesh.faces, dtype=np.uint32)),  # type: ignore[call-overload]
    )
    tensor = o3d.core.Tensor(points.astype(np.float32))  # type: ignore[call-overload]
    closest = scene.compute_closest_points(tensor)
    normals = closest["primitive_normals"].numpy().astype(float)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    colors = np.asarray(mesh.visual.vertex_colors)  # type: ignore[union-attr]
    paint = colors[mesh.faces[closest["primitive_ids"].numpy(), 0], :3]
    classes = {entry.instance: entry.class_name for entry in truth.info.objects}
    vocabulary, meshes = load_vocabulary(), {}
    for k in sorted(set(np.unique(instance).tolist()) & set(classes)):
        own, edge = np.flatnonzero(instance == k), TILE
        if vocabulary.by_name(classes[k]).node == "layout":
            cells = np.floor(points[own] / (2 * TILE)).astype(int)
            own, edge = own[np.sort(np.unique(cells, axis=0, return_index=True)[1])], 2 * TILE
        meshes[k] = tiles(points[own], normals[own], edge, paint[own])
    return write_map(root, meshes, {k: classes[k] for k in meshes})

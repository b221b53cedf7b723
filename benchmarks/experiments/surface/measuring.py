"""How much of the level surface that was seen is in a map, and how much of the map is nowhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d as o3d

from benchmarks.experiments.surface.scenes import Scene, raycasting

GRID = 0.01
"""Seen points are counted once for each cell of this edge [m]."""
LEAST_FRAMES = 3
"""What fewer frames saw counts neither way."""
VOXEL = 0.02
"""What lies within one voxel of the map is mapped; vertices over two voxels from the truth are nowhere [m]."""


@dataclass(frozen=True)
class Surfaced:
    """What an arm makes of a scene."""

    level_mapped: float
    """Share of the seen level area within a voxel of the map."""
    off_truth: float
    """Share of the vertices over two voxels from the true surface."""
    error: float
    """Mean distance of the other vertices from it [m]."""
    vertices: int
    frame_ms: float
    """Processor time of integrating a frame."""
    draw_ms: float
    """Processor time of drawing the surface."""


def seen_level_points(scene: Scene) -> np.ndarray:
    """Return true points (N, 3) float32 on level surfaces with valid depth in some frames, one a grid cell."""
    cells, points = [], []
    for frame in scene.frames:
        seen = frame.points[frame.level]
        cell, first = np.unique(np.floor(seen / GRID).astype(np.int64), axis=0, return_index=True)
        cells.append(cell)
        points.append(seen[first])
    _, first, count = np.unique(np.concatenate(cells), axis=0, return_index=True, return_counts=True)
    return np.concatenate(points)[first][count >= LEAST_FRAMES].astype(np.float32)


def judge(
    scene: Scene, points: np.ndarray, vertices: np.ndarray, faces: np.ndarray, frame_seconds: float, draw_seconds: float
) -> Surfaced:
    """Compare a map (V, 3), (F, 3) with the seen level points (N, 3) and the true surface."""
    mapped = distances(vertices, faces, points) if len(faces) else np.full(len(points), np.inf)
    off = distances(scene.vertices, scene.faces, vertices)
    return Surfaced(
        level_mapped=float(np.mean(mapped <= VOXEL)),
        off_truth=float(np.mean(off > 2 * VOXEL)),
        error=float(off[off <= 2 * VOXEL].mean()),
        vertices=len(vertices),
        frame_ms=1000 * frame_seconds,
        draw_ms=1000 * draw_seconds,
    )


def distances(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the distance (N,) of points (N, 3) from a mesh [m]."""
    tensor = o3d.core.Tensor.from_numpy(np.ascontiguousarray(points, dtype=np.float32))
    found: np.ndarray = raycasting(vertices, faces).compute_distance(tensor).numpy()
    return found

"""Cover a surface mesh with a few boxes: a collision shape that leaves hollow things hollow.

The convex hull of a reconstructed fridge is a block, and physics would throw out of it what lies inside. Here the
voxels that the surface passes are merged greedily into cuboids, apart for surfaces across x, y and z (or a floor would
be as thick as the foot of the wall beside it is high), and each cuboid is shrunk onto its triangles.
"""

from __future__ import annotations

import numpy as np
import trimesh

MINIMUM_THICKNESS = 0.01
"""Smallest edge of a box [m]; by eye."""
LEAST_MAXIMUM, BOXES_PER_AREA = 200, 100.0
"""Most boxes of a mesh: at least so many, and so many for each square metre."""
MINIMUM_AREA_SHARE = 0.1
"""Cuboids with less surface than this share of a voxel's face are noise."""


def cover_with_boxes(
    mesh: trimesh.Trimesh, yaw: float = 0.0, *, voxel_size: float = 0.04, maximum: int | None = None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return boxes (centre (3,), full edge lengths (3,)) [m] over the surface, in the mesh's frame turned by `yaw`.

    A point p of the mesh is Rz(yaw) q for a point q of the boxes' frame. The voxels grow until there are at most
    `maximum` boxes (by default as many as the area needs, 200 for 2 m²). Raises ValueError for no triangles.
    """
    if len(mesh.faces) == 0:
        raise ValueError("mesh has no triangles")
    if maximum is None:
        maximum = max(LEAST_MAXIMUM, int(BOXES_PER_AREA * mesh.area))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1.0]])
    vertices = np.asarray(mesh.vertices, dtype=float) @ turn.T
    while True:
        boxes = _cover(vertices, np.asarray(mesh.faces), voxel_size)
        if len(boxes) <= maximum:
            return boxes
        voxel_size *= 1.4


def _cover(vertices: np.ndarray, faces: np.ndarray, voxel_size: float) -> list[tuple[np.ndarray, np.ndarray]]:
    dense, small = trimesh.remesh.subdivide_to_size(vertices, faces, max_edge=0.5 * voxel_size, max_iter=20)
    corners = dense[small]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across = np.argmax(np.abs(cross), axis=1)
    area = 0.5 * np.linalg.norm(cross, axis=1)
    # half a voxel off, so that the outermost surfaces run through the middle of their cells
    cells = np.floor((corners.mean(axis=1) - dense.min(axis=0)) / voxel_size + 0.5).astype(int)
    boxes: list[tuple[np.ndarray, np.ndarray]] = []
    for axis in range(3):
        facing = np.flatnonzero(across == axis)
        if len(facing) == 0:
            continue
        number = np.zeros(cells[facing].max(axis=0) + 1, dtype=int)
        for k, (first, last) in enumerate(merge_cells(cells[facing])):
            number[tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))] = k
        block = number[tuple(cells[facing].T)]
        order = np.argsort(block, kind="stable")
        starts = np.flatnonzero(np.r_[True, np.diff(block[order]) > 0])
        low = np.minimum.reduceat(corners[facing[order]].min(axis=1), starts)
        high = np.maximum.reduceat(corners[facing[order]].max(axis=1), starts)
        enough = np.add.reduceat(area[facing[order]], starts) >= MINIMUM_AREA_SHARE * voxel_size**2
        size = np.maximum(high - low, MINIMUM_THICKNESS)
        boxes += [(0.5 * (a + b), c) for a, b, c in zip(low[enough], high[enough], size[enough], strict=True)]
    return boxes


def merge_cells(cells: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return cuboids (first cell (3,), last cell (3,)) that partition the distinct cells (N, 3) of a grid.

    Greedy: from the lowest free cell (z, then y, then x) grow along the axis that gains most while all cells are free.
    """
    shape = cells.max(axis=0) + 1
    free = np.zeros(shape, dtype=bool)
    free[tuple(cells.T)] = True
    blocks = []
    for start in np.argwhere(free.transpose(2, 1, 0))[:, ::-1]:
        if not free[tuple(start)]:
            continue
        first, last = start.copy(), start.copy()
        growing = True
        while growing:
            gains = []
            for axis in range(3):
                layer_first, layer_last = first.copy(), last.copy()
                layer_first[axis] = layer_last[axis] = last[axis] + 1
                if layer_last[axis] >= shape[axis]:
                    continue
                layer = free[tuple(slice(a, b + 1) for a, b in zip(layer_first, layer_last, strict=True))]
                if layer.all():
                    gains.append((layer.size, -axis))
            growing = bool(gains)
            if growing:
                last[-max(gains)[1]] += 1
        free[tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))] = False
        blocks.append((first, last))
    return blocks

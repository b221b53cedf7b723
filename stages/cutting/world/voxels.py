"""Which voxels of a grid lie in a closed mesh: crossings of the columns' middles, counted by parity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.compiled import compiled

MARGIN = 1e-4
"""Share of a voxel by which middles of columns are set off from where vertices of regular meshes lie."""


@dataclass(frozen=True)
class Grid:
    """Cubes of edge `voxel` [m]; `origin` is the low corner (3,) [m]."""

    origin: np.ndarray
    voxel: float
    shape: tuple[int, int, int]

    @staticmethod
    def around(low: np.ndarray, high: np.ndarray, voxel: float) -> Grid:
        """Return the grid over a box whose corners are multiples of the voxel: grids of one voxel fit each other."""
        first = np.floor(low / voxel).astype(int)
        last = np.ceil(high / voxel).astype(int)
        x, y, z = (int(n) for n in np.maximum(last - first, 1))
        return Grid(first * voxel, voxel, (x, y, z))


def occupancy(vertices: np.ndarray, faces: np.ndarray, grid: Grid) -> np.ndarray:
    """Return whether the middle of each voxel is inside a closed mesh (V, 3), (F, 3), as bool of the grid's shape."""
    inside = np.zeros(grid.shape, dtype=np.bool_)
    low = grid.origin + grid.voxel * (0.5 + MARGIN * np.array([1.0, 0.618, 0.0]))
    _fill(np.ascontiguousarray(vertices), np.ascontiguousarray(faces), low, grid.voxel, inside)
    return np.asarray(np.logical_xor.accumulate(inside, axis=2))


@compiled
def _is_left_of(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> bool:
    """Whether (x, y) is left of a -> b; the same answer for both triangles of an edge."""
    if ax < bx or (ax == bx and ay < by):
        return bool((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0)
    return bool((ax - bx) * (y - by) - (ay - by) * (x - bx) < 0.0)


@compiled
def _fill(vertices: np.ndarray, faces: np.ndarray, low: np.ndarray, voxel: float, inside: np.ndarray) -> None:
    """Toggle, in every column that a face crosses, the first voxel whose middle is above the crossing."""
    nx, ny, nz = inside.shape
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        doubled = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if doubled == 0.0:
            continue
        first_x = max(0, int(np.floor((min(a[0], b[0], c[0]) - low[0]) / voxel)))
        last_x = min(nx - 1, int(np.ceil((max(a[0], b[0], c[0]) - low[0]) / voxel)))
        first_y = max(0, int(np.floor((min(a[1], b[1], c[1]) - low[1]) / voxel)))
        last_y = min(ny - 1, int(np.ceil((max(a[1], b[1], c[1]) - low[1]) / voxel)))
        for i in range(first_x, last_x + 1):
            x = low[0] + voxel * i
            for j in range(first_y, last_y + 1):
                y = low[1] + voxel * j
                ab = _is_left_of(a[0], a[1], b[0], b[1], x, y)
                if _is_left_of(b[0], b[1], c[0], c[1], x, y) != ab or _is_left_of(c[0], c[1], a[0], a[1], x, y) != ab:
                    continue
                of_b = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / doubled
                of_c = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / doubled
                z = a[2] + of_b * (b[2] - a[2]) + of_c * (c[2] - a[2])
                k = max(0, int(np.ceil((z - low[2]) / voxel)))
                if k < nz:
                    inside[i, j, k] = not inside[i, j, k]

"""What sticks out of the shape that a thing is believed to have: a handle that the voxels of a map lost.

Fingers that close where a handle is come to rest on it, and a palm that passes there takes the cup along.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.box_cover import merge_cells
from scenewright.stages.kit.geometry.point_clouds import clusters
from scipy.spatial import cKDTree

BEYOND = 0.01
"""Points seen farther than this from the surface are of nothing that is believed of the thing [m]."""
CELL = 0.005
"""Edge of the cells that they fill [m]."""
LEAST_POINTS = 3
"""Least points of a cell: beside an edge single pixels take a depth between near and far."""
LEAST_SHARE = 0.04
"""Least share of what was seen. A handle is a tenth or a twentieth of it; strays, from what stands beside a thing, a
fortieth."""
LINK = 0.03
"""Points of one part are no farther apart [m]."""

Box = tuple[np.ndarray, np.ndarray]
"""Centre and edge lengths (3,) [m]."""


def sticking_out(seen: np.ndarray, surface: np.ndarray) -> list[Box]:
    """Return boxes over what was seen (N, 3) and is not of a surface (M, 3) of the same frame: its largest part."""
    away = cKDTree(surface).query(seen)[0]
    points = seen[away > BEYOND]
    points = points[clusters(points, LINK) == 0]
    if len(points) < LEAST_SHARE * len(seen):
        return []
    cells, counts = np.unique(np.floor(points / CELL).astype(int), axis=0, return_counts=True)
    cells = cells[counts >= LEAST_POINTS]
    if not len(cells):
        return []
    origin = cells.min(axis=0)
    return [
        ((origin + (first + last + 1) / 2) * CELL, (last - first + 1.0) * CELL)
        for first, last in merge_cells(cells - origin)
    ]

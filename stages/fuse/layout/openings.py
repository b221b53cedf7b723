"""Holes in a wall through which cameras looked: doors that stand open, and windows."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.panoptic_map import Opening
from scenewright.stages.fuse.layout.evidence import BEHIND, NARROWEST, Scene
from scenewright.stages.fuse.layout.planes import CELL, Plane
from scipy import ndimage

LOWEST = 6
"""Fewest cells of an opening in height."""
FILLED = 0.6
"""Least share of an opening's rectangle that was looked through."""
THRESHOLD = 2
"""Cells over the floor that rays over a threshold do not reach."""


def openings_of(plane: Plane, scene: Scene, floor: float) -> tuple[Opening, ...]:
    """Return the openings of a wall, the left ones first; `floor` [m]. Of a scan there are none."""
    if scene.free is None:
        return ()
    cells = np.unique(plane.cells(scene.vertices[plane.members]), axis=0)
    low = np.array([cells[:, 0].min(), int(np.floor(floor / CELL))])
    shape = cells.max(axis=0) - low + 1
    surface = np.zeros(shape, bool)
    kept = cells[(cells >= low).all(axis=1)]
    surface[tuple((kept - low).T)] = True
    grid = np.argwhere(~surface) + low
    seen = np.zeros(len(grid), bool)
    for depth in BEHIND:
        seen |= scene.free.is_free(plane.at(grid, -depth))
    through = np.zeros(shape, bool)
    through[tuple((grid[seen] - low).T)] = True
    labels, _ = ndimage.label(ndimage.binary_opening(through, np.ones((2, 2), bool)))
    openings = []
    for number, (columns, rows) in enumerate(ndimage.find_objects(labels), 1):
        width, height = columns.stop - columns.start, rows.stop - rows.start
        if width < NARROWEST or height < LOWEST or (labels[columns, rows] == number).mean() < FILLED:
            continue
        bottom = rows.start
        if 0 < bottom <= THRESHOLD and surface[columns, :bottom].mean() < 0.5:
            bottom = 0
        openings.append(
            Opening(
                left=round((columns.start + low[0] - cells[:, 0].min()) * CELL, 3),
                width=round(width * CELL, 3),
                sill=round(bottom * CELL, 3),
                head=round(rows.stop * CELL, 3),
            )
        )
    return tuple(openings)

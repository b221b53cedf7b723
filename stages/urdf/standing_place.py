"""Where on a floor there is most room: the middle of the largest disc between what stands about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.geometry.boxes import bottom, box_corners, top
from scipy import ndimage
from shapely import contains_xy
from shapely.geometry import MultiPoint

CELL = 0.05
"""Edge of the cells of the floor [m]."""
FLOOR, HEAD = 0.05, 1.5
"""What ends lower over the floor is stepped on, and what begins higher is passed under [m]."""


def roomiest_place(
    floor: np.ndarray, boxes: Sequence[Box], surface: np.ndarray | None = None
) -> tuple[np.ndarray, float] | None:
    """Return the middle (2,) [m] of the largest free disc on a floor, and its radius [m]; None where nothing is free.

    `floor` (N, 3) [m]: points of the floor that were seen, world frame, at most a cell apart; `boxes`: around what
    stands about; `surface` (M, 3): points of what stands about and fills no box.
    """
    if not len(floor):
        return None
    height = float(np.median(floor[:, 2]))
    cells = np.floor(floor[:, :2] / CELL).astype(int)
    low = cells.min(axis=0) - 1
    free = np.zeros(cells.max(axis=0) - low + 2, bool)
    free[tuple((cells - low).T)] = True
    free = ndimage.binary_closing(free)
    middles = (np.argwhere(np.ones_like(free)) + low + 0.5) * CELL
    for box in boxes:
        if top(box) > height + FLOOR and bottom(box) < height + HEAD:
            outline = MultiPoint(np.asarray(box_corners(box))[:, :2]).convex_hull
            free[contains_xy(outline, middles[:, 0], middles[:, 1]).reshape(free.shape)] = False
    if surface is not None and len(surface):
        beside = surface[(surface[:, 2] > height + FLOOR) & (surface[:, 2] < height + HEAD)]
        taken = np.floor(beside[:, :2] / CELL).astype(int) - low
        taken = taken[((taken >= 0) & (taken < free.shape)).all(axis=1)]
        free[tuple(taken.T)] = False
    distance = ndimage.distance_transform_edt(free)
    best = np.unravel_index(int(distance.argmax()), distance.shape)
    if not free[best]:
        return None
    return (np.array(best) + low + 0.5) * CELL, float(distance[best] * CELL)

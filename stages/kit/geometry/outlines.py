"""Pixels that an outline encloses, one by one those of COCO's own tools.

As pycocotools does it (maskApi.c: rleFrPoly): points are rounded to fifths of a pixel, every edge is walked in such
steps, and where it passes the middle of a column, the pixels from there to the next such place belong to the mask.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.errors import BadInput

STEPS = 5
"""Steps of the walk a pixel."""
LONGEST_OUTLINE = 2**22
"""Most steps around all polygons of one mask (840,000 pixels of outline); a guard, by eye."""


def fill(polygons: Sequence[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """Return the mask (H, W) bool of what polygons (K, 2) x, y [pixels] enclose, together; (0, 0) is the corner of the
    first pixel. What reaches over the picture is cut off. Raises BadInput for numbers that are not finite, and for an
    outline that is longer than any picture's."""
    columns = np.zeros(shape[::-1], dtype=bool)
    steps = 0.0
    for points in polygons:
        if not np.isfinite(points).all():
            raise BadInput("its outline has a number that is not finite", hint="write the polygon again")
        steps += float(STEPS * np.abs(np.roll(points, -1, axis=0) - points).max(axis=1).sum()) + len(points)
    if steps > LONGEST_OUTLINE:
        raise BadInput(f"its outline is {steps / STEPS:.0f} pixels long", hint="coordinates of polygons are pixels")
    for points in polygons:
        _fill_one(points, columns)
    return np.ascontiguousarray(columns.T)


def _fill_one(points: np.ndarray, columns: np.ndarray) -> None:
    """Set the pixels of `columns` (W, H) that a polygon encloses."""
    width, height = columns.shape
    first = np.trunc(STEPS * points + 0.5).astype(np.int64)
    last = np.roll(first, -1, axis=0)
    span = np.abs(last - first)
    flat = span[:, 0] >= span[:, 1]  # walked by columns, else by rows
    backwards = np.where(flat, first[:, 0] > last[:, 0], first[:, 1] > last[:, 1])
    low, high = np.where(backwards[:, None], last, first), np.where(backwards[:, None], first, last)
    longer, shorter = np.where(flat[:, None], span, span[:, ::-1]).T
    rise = np.where(flat, high[:, 1] - low[:, 1], high[:, 0] - low[:, 0])
    slope = rise / np.maximum(longer, 1)
    edge = np.repeat(np.arange(len(points)), longer + 1)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(longer + 1) - longer - 1, longer + 1)
    step = np.where(backwards[edge], longer[edge] - step, step)
    along = step + np.where(flat, low[:, 0], low[:, 1])[edge]
    across = np.trunc(np.where(flat, low[:, 1], low[:, 0])[edge] + slope[edge] * step + 0.5).astype(np.int64)
    u, v = np.where(flat[edge], along, across), np.where(flat[edge], across, along)
    left = np.where(u[1:] < u[:-1], u[1:], u[1:] - 1)
    middle = (u[1:] != u[:-1]) & (left % STEPS == STEPS // 2) & (left >= 0) & (left // STEPS < width)
    row = np.ceil(np.clip((np.minimum(v[1:], v[:-1])[middle] + 0.5) / STEPS - 0.5, 0, height)).astype(np.int64)
    column = left[middle] // STEPS
    if len(column):
        start, end = int(column.min()), int(column.max()) + 1
        passed = np.bincount((column - start) * height + row, minlength=(end - start) * height)[
            : (end - start) * height
        ]
        columns[start:end] |= (np.cumsum(passed, dtype=np.uint8) & 1).astype(bool).reshape(-1, height)

"""Masks out of outlines, pixel by pixel those of COCO's own tools.

As pycocotools does it (maskApi.c: rleFrPoly): points are rounded to fifths of a pixel, every edge is walked in such
steps, and where it passes the middle of a column, the pixels from there to the next such place belong to the mask.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput

STEPS = 5
"""Steps of the walk a pixel."""
LONGEST_OUTLINE = 2**22
"""Most steps around all polygons of one mask (840,000 pixels of outline); a guard, by eye."""
BEYOND = 1.0
"""How far an outline may reach over a picture whose size nobody says [pixels]."""
CORNERS = 64
"""Corners of a circle or an ellipse."""


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


def polygons_of(outline: Any) -> list[np.ndarray]:
    """Return the polygons (K, 2) of a COCO segmentation: a list of lists x1, y1, x2, y2, ...; one such list, and a list
    of points, are taken for one polygon. What has fewer than three corners encloses nothing and is left out.

    Raises BadInput, in words that follow the name of the mask, when it is no list of numbers in pairs.
    """
    if not isinstance(outline, list):
        raise BadInput("its outline is no list of polygons", hint="[[x1, y1, x2, y2, x3, y3, ...], ...]")
    if outline and all(_is_number(value) for value in outline):
        outline = [outline]
    if len(outline) > 2 and all(isinstance(part, list) and len(part) == 2 for part in outline):
        outline = [[value for part in outline for value in part]]
    polygons = []
    for part in outline:
        if not isinstance(part, list) or len(part) % 2 or not all(_is_number(value) for value in part):
            raise BadInput(
                "one of its polygons is no list of numbers in pairs", hint="[[x1, y1, x2, y2, x3, y3, ...], ...]"
            )
        if len(part) >= 6:
            polygons.append(np.array(part, dtype=np.float64).reshape(-1, 2))
    return polygons


def ellipse(center: tuple[float, float], radii: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    """Return a polygon (CORNERS, 2) for an ellipse turned by `turn` [rad] from x to y."""
    angle = np.arange(CORNERS) * (2 * np.pi / CORNERS)
    points = np.stack([radii[0] * np.cos(angle), radii[1] * np.sin(angle)], axis=1)
    return turned(points + center, center, turn)


def rectangle(corner: tuple[float, float], size: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    """Return a polygon (4, 2) for a rectangle turned by `turn` [rad] about its corner."""
    (x, y), (wide, high) = corner, size
    return turned(np.array([[x, y], [x + wide, y], [x + wide, y + high], [x, y + high]]), corner, turn)


def turned(points: np.ndarray, about: tuple[float, float], turn: float) -> np.ndarray:
    """Return points (K, 2) turned by `turn` [rad] from x to y."""
    c, s = np.cos(turn), np.sin(turn)
    return (points - about) @ np.array([[c, s], [-s, c]]) + about


def check_size(size: tuple[int, int] | None, polygons: Sequence[np.ndarray], shape: tuple[int, int]) -> None:
    """Raise BadInput when polygons are of pictures of another `size` (width, height) than a frame of `shape` (H, W);
    None: nobody says it, and they must not reach over the frame."""
    hint = "outlines have the size of the sequence's pictures; scale them"
    if size is not None and size != (shape[1], shape[0]):
        raise BadInput(
            f"its outline is of a picture of {size[0]}x{size[1]}, the frame has {shape[1]}x{shape[0]} pixels", hint=hint
        )
    if size is None and polygons:
        reach = np.concatenate(polygons).max(axis=0)
        if reach[0] > shape[1] + BEYOND or reach[1] > shape[0] + BEYOND:
            raise BadInput(
                f"its outline reaches to ({reach[0]:.0f}, {reach[1]:.0f}), the frame has {shape[1]}x{shape[0]} pixels",
                hint=hint,
            )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9

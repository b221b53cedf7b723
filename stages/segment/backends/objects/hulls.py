"""Convex hulls of image regions: what a solid's silhouette should fill, and what hides the rest of it."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled


@compiled
def convex_hull(points: np.ndarray) -> np.ndarray:
    """Return the corners (K, 2) of the convex hull of points (N, 2) float64, counter-clockwise in a y-up frame, no
    three in a line (Andrew 1979, monotone chain). One or two distinct points are returned as they are."""
    count = len(points)
    keys = np.argsort(points[:, 0] * 65536.0 + points[:, 1])
    hull = np.empty((2 * count + 1, 2), dtype=np.float64)
    size = 0
    for turn in range(2):
        start = size
        for k in range(count):
            point = points[keys[k if turn == 0 else count - 1 - k]]
            while size - start >= 2:
                ax, ay = hull[size - 1, 0] - hull[size - 2, 0], hull[size - 1, 1] - hull[size - 2, 1]
                bx, by = point[0] - hull[size - 2, 0], point[1] - hull[size - 2, 1]
                if ax * by - ay * bx > 0.0:
                    break
                size -= 1
            hull[size] = point
            size += 1
        # The last point of a chain is the first of the other.
        size -= 1
    return hull[: max(size, 1)].copy()


@compiled
def hull_span(hull: np.ndarray, row: float) -> tuple[float, float]:
    """Return the first and the last column in which a hull (K, 2) of (column, row) meets a row; first > last: never."""
    first, last = 1e9, -1e9
    count = len(hull)
    for k in range(count):
        x0, y0 = hull[k, 0], hull[k, 1]
        x1, y1 = hull[(k + 1) % count, 0], hull[(k + 1) % count, 1]
        low, high = min(y0, y1), max(y0, y1)
        if row < low or row > high:
            continue
        if high == low:
            first, last = min(first, x0, x1), max(last, x0, x1)
        else:
            x = x0 + (x1 - x0) * (row - y0) / (y1 - y0)
            first, last = min(first, x), max(last, x)
    return first, last


@compiled
def hull_content(
    hull: np.ndarray,
    groups: np.ndarray,
    inverse: np.ndarray,
    a: int,
    b: int,
    plane: np.ndarray,
    margin: float,
    step: int,
) -> tuple[float, float, float, float]:
    """Return what a hull (K, 2) of (column, row) holds: pixels of groups a or b, pixels that something nearer hides,
    pixels without depth, pixels that show what lies behind.

    `groups` (H, W) group of every pixel; `inverse` (H, W) inverse depth [1/m], 0 without; `plane` (3,) gives the
    inverse depth of a and b as plane[0] + plane[1] column + plane[2] row. Nearer by `margin` [1/m] hides. Every
    `step`-th row and column is looked at; the numbers are scaled to all.
    """
    height, width = groups.shape
    covered = hidden = missing = behind = 0.0
    low, high = hull[:, 1].min(), hull[:, 1].max()
    row = int(np.ceil(low / step)) * step
    while row <= high:
        if 0 <= row < height:
            first, last = hull_span(hull, float(row))
            column = int(np.ceil(first / step)) * step
            while column <= last:
                if 0 <= column < width:
                    group = groups[row, column]
                    if group in (a, b):
                        covered += 1.0
                    elif inverse[row, column] <= 0.0:
                        missing += 1.0
                    elif group > 0 and inverse[row, column] > plane[0] + plane[1] * column + plane[2] * row + margin:
                        hidden += 1.0
                    else:
                        behind += 1.0
                column += step
        row += step
    scale = float(step * step)
    return covered * scale, hidden * scale, missing * scale, behind * scale


@compiled
def inside_hull(hull: np.ndarray, x: float, y: float) -> bool:
    """Return whether (x, y) lies in a hull (K, 2) as convex_hull returns it, border included."""
    count = len(hull)
    for k in range(count):
        x0, y0 = hull[k, 0], hull[k, 1]
        x1, y1 = hull[(k + 1) % count, 0], hull[(k + 1) % count, 1]
        if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) < -1e-9:
            return False
    return True

"""Plates with holes: a mask over squares of a rectangle as boxes to collide with, and as one closed surface."""

from __future__ import annotations

import numpy as np


def without_corner_contacts(solid: np.ndarray) -> np.ndarray:
    """Return a mask (N, M) bool in which no two full cells meet at a corner alone: one of them goes, as two plates that
    share an edge are no closed surface."""
    kept = solid.copy()
    while True:
        a, b, c, d = kept[:-1, :-1], kept[1:, 1:], kept[1:, :-1], kept[:-1, 1:]
        falling, rising = a & b & ~c & ~d, c & d & ~a & ~b
        if not (falling.any() or rising.any()):
            return kept
        kept[1:, 1:] &= ~falling
        kept[1:, :-1] &= ~rising


def rectangles_of(solid: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Return rectangles (first column, first row, end column, end row) that fill a mask (N, M) bool and do not overlap:
    the one of most cells first, then the same of what is left."""
    left = solid.copy()
    found = []
    while left.any():
        best = largest_rectangle(left)
        left[best[0] : best[2], best[1] : best[3]] = False
        found.append(best)
    return found


def largest_rectangle(solid: np.ndarray) -> tuple[int, int, int, int]:
    """Return the rectangle of most cells that is full in a mask (N, M) bool (Vandevoorde 1998: a stack of the full
    stretches that end at each column)."""
    run = np.zeros(solid.shape[1] + 1, int)
    best, most = (0, 0, 0, 0), 0
    for column in range(solid.shape[0]):
        run[:-1] = np.where(solid[column], run[:-1] + 1, 0)
        stack: list[tuple[int, int]] = []
        for row, length in enumerate(run.tolist()):
            start = row
            while stack and stack[-1][1] >= length:
                start, longer = stack.pop()
                if longer * (row - start) > most:
                    most, best = longer * (row - start), (column + 1 - longer, start, column + 1, row)
            stack.append((start, length))
    return best


def closed_plate(solid: np.ndarray, columns: np.ndarray, rows: np.ndarray, depth: float) -> tuple[np.ndarray, ...]:
    """Return vertices (V, 3) and faces (F, 3), outward, of a closed plate over the full cells of a mask (N, M) bool.

    x and y of the cells' edges are `columns` (N + 1,) and `rows` (M + 1,) [m]; the front is at z = 0 and looks along z,
    the back at -`depth` [m]. Cells must not meet at a corner alone (`without_corner_contacts`).
    """
    wide, high = solid.shape[0] + 1, solid.shape[1] + 1
    number = np.arange(wide * high).reshape(wide, high)
    i, j = np.nonzero(solid)
    square = np.stack([number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]], axis=1)
    back = square[:, ::-1] + wide * high
    around = np.pad(solid, 1)
    sides = []
    for (step_i, step_j), (first, second) in {
        (0, -1): (0, 1), (1, 0): (1, 2), (0, 1): (2, 3), (-1, 0): (3, 0)
    }.items():  # fmt: skip
        bare = ~around[i + 1 + step_i, j + 1 + step_j]
        a, b = square[bare, first], square[bare, second]
        sides.append(np.stack([b, a, a + wide * high, b + wide * high], axis=1))
    quads = np.concatenate([square, back, *sides])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    x, y = np.meshgrid(columns, rows, indexing="ij")
    front = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    vertices = np.concatenate([front, front - [0.0, 0.0, depth]])
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)

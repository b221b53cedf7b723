"""Distances over free cells of a grid by fast marching (Sethian 1996), and paths down their slope."""

from __future__ import annotations

import heapq

import numpy as np
from scenewright.stages.kit.compiled import compiled


@compiled
def distances(free: np.ndarray, cost: np.ndarray, row: int, column: int) -> np.ndarray:
    """Return (H, W) the travel distance [cells] from a cell over the free ones (bool); inf where there is no way.

    First-order upwind solution of the eikonal equation; `cost` (H, W): of a cell's length in each cell.
    """
    height, width = free.shape
    distance = np.full((height, width), np.inf)
    done = np.zeros((height, width), np.bool_)
    distance[row, column] = 0.0
    queue = [(0.0, row, column)]
    while len(queue) > 0:
        value, r, c = heapq.heappop(queue)
        if done[r, c]:
            continue
        done[r, c] = True
        for k in range(4):
            i, j = r + (k == 0) - (k == 1), c + (k == 2) - (k == 3)
            if i < 0 or j < 0 or i >= height or j >= width or done[i, j] or not free[i, j]:
                continue
            up = min(distance[i - 1, j] if i > 0 else np.inf, distance[i + 1, j] if i + 1 < height else np.inf)
            side = min(distance[i, j - 1] if j > 0 else np.inf, distance[i, j + 1] if j + 1 < width else np.inf)
            smaller, larger = min(up, side), max(up, side)
            h = cost[i, j]
            through_cell = (
                smaller + h
                if larger - smaller >= h
                else 0.5 * (smaller + larger + np.sqrt(2.0 * h * h - (larger - smaller) ** 2))
            )
            if through_cell < distance[i, j]:
                distance[i, j] = through_cell
                heapq.heappush(queue, (through_cell, i, j))
    return distance

"""Where a person can walk: clearance over the floor on a grid, and shortest paths through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.synthesize.parameters import OTHER_ROOM
from scipy.ndimage import map_coordinates
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

CELL = 0.05
"""Edge of a cell of the floor [m]."""
BODY_HEIGHTS = (0.12, 0.35, 0.6, 0.85, 1.1, 1.35, 1.6)
"""Heights at which the clearance is measured; its minimum counts [m]."""
BODY_RADIUS = 0.36
"""Clearance that walking needs [m]; more than what the camera keeps."""


@dataclass(frozen=True)
class FreeSpace:
    """Clearance of a body over every floor cell, and the connected region that is walked."""

    origin: np.ndarray
    """(2,) centre of cell (0, 0) [m]."""
    clearance: np.ndarray
    """(NX, NY) distance to the nearest surface over all body heights [m]."""
    walkable: np.ndarray
    """(NX, NY) bool: the largest connected region with enough clearance."""
    node: np.ndarray
    """(NX, NY) int: graph node of a walkable cell, -1 elsewhere."""
    graph: coo_matrix

    def cells(self) -> np.ndarray:
        """Return the centres (N, 2) [m] of the walkable cells, by node."""
        return self.origin + CELL * np.argwhere(self.walkable)

    def clearance_at(self, points: np.ndarray) -> np.ndarray:
        """Return the interpolated clearance (N,) [m] at floor points (N, 2); 0 outside the grid."""
        where = ((np.asarray(points)[:, :2] - self.origin) / CELL).T
        return map_coordinates(self.clearance, where, order=1, mode="constant", cval=0.0)

    def nearest_node(self, point: np.ndarray) -> int:
        """Return the walkable node nearest to a floor point (2,)."""
        return int(np.argmin(np.linalg.norm(self.cells() - point, axis=1)))

    def path(self, start: int, end: int) -> np.ndarray:
        """Return the floor points (K, 2) [m] of the cheapest path between two nodes; narrow places cost more."""
        _, before = dijkstra(self.graph, indices=start, return_predecessors=True)
        nodes = [end]
        while nodes[-1] != start:
            nodes.append(int(before[nodes[-1]]))
        return self.cells()[nodes[::-1]]


def find_free_space(renderer: SceneRenderer, room_size: np.ndarray) -> FreeSpace:
    """Measure the clearance in a room whose floor's middle is the origin. Raises BadInput when nobody can walk."""
    count = np.floor(room_size[:2] / CELL).astype(int)
    origin = -0.5 * CELL * (count - 1)
    i, j = np.meshgrid(np.arange(count[0]), np.arange(count[1]), indexing="ij")
    floor = origin + CELL * np.stack([i, j], axis=-1)
    levels = []
    for height in BODY_HEIGHTS:
        points = np.concatenate([floor, np.full((*floor.shape[:2], 1), height)], axis=-1).reshape(-1, 3)
        # The floor itself is no obstacle to feet.
        distance = renderer.distance(points)
        levels.append(np.where(distance >= height - 1e-3, np.maximum(distance, 0.5), distance).reshape(i.shape))
    clearance = np.min(levels, axis=0)
    free = clearance >= BODY_RADIUS
    if not free.any():
        raise BadInput("there is no floor to walk on", hint=OTHER_ROOM)
    graph, node = _grid_graph(free, clearance)
    _, labels = connected_components(graph, directed=False)
    largest = np.bincount(labels).argmax()
    walkable = np.zeros_like(free)
    walkable[free] = labels == largest
    graph, node = _grid_graph(walkable, clearance)
    return FreeSpace(origin, clearance, walkable, node, graph)


def _grid_graph(free: np.ndarray, clearance: np.ndarray) -> tuple[coo_matrix, np.ndarray]:
    """Return the 8-connected graph of the free cells with costs length * (1 + 0.3 / clearance)."""
    node = np.full(free.shape, -1)
    node[free] = np.arange(int(free.sum()))
    rows, columns, costs = [], [], []
    for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
        a = (slice(0, free.shape[0] - di), slice(max(0, -dj), free.shape[1] - max(0, dj)))
        b = (slice(di, None), slice(max(0, dj), free.shape[1] + min(0, dj)))
        both_free = free[a] & free[b]
        length = CELL * float(np.hypot(di, dj))
        rows.append(node[a][both_free])
        columns.append(node[b][both_free])
        costs.append(length * (1.0 + 0.3 / np.minimum(clearance[a][both_free], clearance[b][both_free])))
    row, column, cost = np.concatenate(rows), np.concatenate(columns), np.concatenate(costs)
    size = int(free.sum())
    graph = coo_matrix(
        (np.tile(cost, 2), (np.concatenate([row, column]), np.concatenate([column, row]))), shape=(size, size)
    )
    return graph.tocsr(), node

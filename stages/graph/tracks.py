"""Which node of one partial map is which of the next: the one on the same surface, whatever both are called."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import count

import numpy as np
from scenewright.stages.graph.nodes import Entity
from scipy.optimize import linear_sum_assignment

CELL = 0.04
"""Edge of the grid on which surfaces are compared [m]."""
LEAST_SHARE = 0.5
"""Two nodes can be the same when so much of the smaller surface is in the larger one."""
COORDINATE_LIMIT = 1 << 20
"""Added to the coordinates of cells, so that three of 21 bits make one number."""


def cells_of(points: np.ndarray) -> np.ndarray:
    """Return the occupied cells of points (N, 3) [m] as ascending integers."""
    cell = np.floor(np.asarray(points, dtype=float).reshape(-1, 3) / CELL).astype(np.int64) + COORDINATE_LIMIT
    return np.unique((cell[:, 0] * 2 * COORDINATE_LIMIT + cell[:, 1]) * 2 * COORDINATE_LIMIT + cell[:, 2])


@dataclass(frozen=True)
class Followed:
    """The tracks of one partial map."""

    of_node: dict[str, int]
    """Node -> track."""
    merged: dict[int, int]
    """Track of the map before that is no node any more -> track that now holds most of its surface."""


@dataclass
class Tracks:
    """Nodes through a series of partial maps. A track is a number; it keeps the cells that it had when last seen."""

    cells: dict[int, np.ndarray] = field(default_factory=dict)
    layout: dict[int, str] = field(default_factory=dict)
    """Class of the tracks that are layout, which never become things, nor another layout class."""
    alive: frozenset[int] = frozenset()

    def follow(self, entities: list[Entity]) -> Followed:
        """Give every node of the next map a track: assignment with the most shared cells; new ones for the rest."""
        entity_cells = [cells_of(entity.points) for entity in entities]
        kinds = [entity.class_name if entity.node_type == "layout" else "" for entity in entities]
        tracks = sorted(self.cells)
        shared = np.zeros((len(tracks), len(entities)))
        for i, track in enumerate(tracks):
            for j, cells in enumerate(entity_cells):
                if self.layout.get(track, "") == kinds[j]:
                    common = len(np.intersect1d(self.cells[track], cells, assume_unique=True))
                    smaller = min(len(self.cells[track]), len(cells))
                    shared[i, j] = common if common >= LEAST_SHARE * max(smaller, 1) else 0.0
        of_node: dict[str, int] = {}
        for i, j in zip(*linear_sum_assignment(-shared), strict=True):
            if shared[i, j] > 0.0:
                of_node[entities[j].name] = tracks[i]
        fresh = count(len(self.cells))
        for entity in entities:
            if entity.name not in of_node:
                of_node[entity.name] = next(fresh)
        merged: dict[int, int] = {}
        for i, track in enumerate(tracks):
            if track in self.alive and track not in of_node.values() and shared[i].any():
                merged[track] = of_node[entities[int(shared[i].argmax())].name]
        for entity, cells, kind in zip(entities, entity_cells, kinds, strict=True):
            self.cells[of_node[entity.name]] = cells
            if kind:
                self.layout[of_node[entity.name]] = kind
        self.alive = frozenset(of_node.values())
        return Followed(of_node, merged)

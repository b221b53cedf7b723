"""Which true thing a thing of a map is, and what the map has of each true thing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.edit import MapState
from scenewright.stages.evaluate import TrueRoom, nearest_labels

NEAR = 0.05
"""A vertex belongs to the true surface at most this far [m]."""
MOST = 0.5
"""A thing of the map is the true one that so much of its surface belongs to."""


@dataclass(frozen=True)
class MapTruth:
    """What a map is in truth."""

    object_of: dict[int, int]
    """Thing of the map -> true thing; without those that are no single true one."""
    covered_by: dict[int, int]
    """True thing -> thing of the map that most of its seen surface is called, 0 none."""

    def has(self, true: int) -> bool:
        """Whether a thing of the map is this true one."""
        return true in self.object_of.values()


def true_object(points: np.ndarray, room: TrueRoom, things: frozenset[int]) -> int:
    """Return the true thing that most of the points (N, 3) [m] belong to, 0 for none."""
    labels = nearest_labels(points, room.points, room.instances, NEAR)
    numbers, counts = np.unique(labels, return_counts=True)
    best = int(np.argmax(counts)) if len(counts) else 0
    return int(numbers[best]) if len(counts) and counts[best] >= MOST * len(points) and numbers[best] in things else 0


def truth_of(state: MapState, room: TrueRoom) -> MapTruth:
    """Return what the things of a map are in truth."""
    things = frozenset(entry.instance for entry in room.evaluated(things_only=True))
    found = {
        k.instance: true_object(np.asarray(k.surface.data), room, things)
        for k in state.things()
        if k.surface is not None
    }
    covered = {}
    for true in sorted(things):
        points = room.points[room.instances == true]
        labels = nearest_labels(points, state.surface.vertices.astype(float), state.instance, NEAR)
        numbers, counts = np.unique(labels, return_counts=True)
        covered[true] = int(numbers[np.argmax(counts)])
    return MapTruth({k: true for k, true in found.items() if true}, covered)

"""Which replaced objects of a room lie in each other, in the floor or in the walls, how deep, and with what volume."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scenewright.stages.kit.measurement.convex_overlap import ConvexPiece, penetration_depth, shared_volume

COLLISION_DEPTH = 0.005
"""Pairs deeper than this collide [m]."""
TOUCHING = 1e-6
"""Pairs up to this depth only touch [m]."""


@dataclass(frozen=True)
class Penetration:
    """Two things that share space."""

    first: str
    second: str
    depth: float
    """Shortest way that takes the deepest pair of convex pieces apart [m]."""
    volume: float
    """Shared by the unions of their pieces, counted on a grid [m^3]."""
    layout: bool
    """Whether the second is floor, wall or ceiling."""

    @property
    def collides(self) -> bool:
        """Whether the depth is more than 5 mm."""
        return self.depth > COLLISION_DEPTH


def room_penetrations(
    objects: Mapping[str, Sequence[ConvexPiece]], layout: Mapping[str, Sequence[ConvexPiece]] | None = None
) -> list[Penetration]:
    """Return all pairs of objects, and of objects with layout, that lie in each other, deepest first.

    Pieces are convex, in the world [m]. A thing may touch what carries it; it may not be in it: no pair is let through.
    """
    pairs = [(a, b, objects[a], objects[b], False) for a, b in combinations(sorted(objects), 2)]
    pairs += [(a, b, objects[a], (layout or {})[b], True) for a in sorted(objects) for b in sorted(layout or {})]
    bounds = {name: _bounds(pieces) for name, pieces in (*objects.items(), *(layout or {}).items())}
    penetrations = []
    for first, second, pieces, others, fixed in pairs:
        (low, high), (other_low, other_high) = bounds[first], bounds[second]
        if np.any(low >= other_high) or np.any(other_low >= high):
            continue
        depth = penetration_depth(pieces, others)
        if depth > TOUCHING:
            penetrations.append(Penetration(first, second, depth, shared_volume(pieces, others), fixed))
    return sorted(penetrations, key=lambda p: (-p.depth, p.first, p.second))


def _bounds(pieces: Sequence[ConvexPiece]) -> tuple[np.ndarray, np.ndarray]:
    if not pieces:
        return np.full(3, np.inf), np.full(3, -np.inf)
    return np.min([p.low for p in pieces], axis=0), np.max([p.high for p in pieces], axis=0)

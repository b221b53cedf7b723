"""Collisions between placed models, and min-conflicts over the candidates (Han 2024, section 2.4.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cad.model_surfaces import ModelSurface, to_world
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.geometry.convex_solids import Solid, convex_solid


def placed_solid(placement: Placement, surface: ModelSurface) -> Solid:
    """Return the convex collision pieces of a placed model, ready for collision queries."""
    return convex_solid(placed_pieces(placement, surface))


def placed_pieces(placement: Placement, surface: ModelSurface) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return vertices (V, 3) in the world and faces (F, 3) of the convex collision pieces of a placed model."""
    return [(to_world(placement, v), f) for v, f in surface.posed_pieces(placement.shape.joints)]


@dataclass(frozen=True)
class Selection:
    """Result of min-conflicts."""

    choice: tuple[int, ...]
    """Index of the candidate of each object."""
    conflicts_before: int
    """Colliding pairs with the first candidate of every object."""
    conflicts_after: int
    steps: int


def min_conflicts(
    counts: list[int],
    depth: Callable[[int, int, int, int], float],
    *,
    tolerance: float,
    iterations: int,
    random: np.random.Generator,
) -> Selection:
    """Choose one candidate per object such that no pair interpenetrates (min-conflicts, [MJP92] in the thesis).

    `counts`: number of candidates of each object, best first; `depth(i, a, j, b)`: penetration [m] of candidate a of
    object i and candidate b of object j, 0 for pairs that may touch. Every step takes a random object in conflict and
    gives it the candidate with the smallest summed penetration; equal ones fall to the better candidate. Returns the
    best choice met, which is the first one again when nothing is better.
    """
    choice = [0] * len(counts)

    def colliding(selected: list[int]) -> list[tuple[int, int, float]]:
        conflicts = []
        for i in range(len(selected)):
            for j in range(i + 1, len(selected)):
                value = depth(i, selected[i], j, selected[j])
                if value > tolerance:
                    conflicts.append((i, j, value))
        return conflicts

    pairs = colliding(choice)
    before = len(pairs)
    best, best_rank = list(choice), (len(pairs), sum(pair[2] for pair in pairs))
    steps = 0
    while pairs and steps < iterations:
        steps += 1
        conflicted = sorted({k for pair in pairs for k in pair[:2]})
        i = conflicted[int(random.integers(len(conflicted)))]
        sums = []
        for a in range(counts[i]):
            values = [depth(i, a, j, choice[j]) for j in range(len(counts)) if j != i]
            sums.append(sum(value for value in values if value > tolerance))
        choice[i] = int(np.argmin(np.round(sums, 6)))
        pairs = colliding(choice)
        rank = (len(pairs), sum(pair[2] for pair in pairs))
        if rank < best_rank:
            best, best_rank = list(choice), rank
    return Selection(tuple(best), before, best_rank[0], steps)

"""The nearest place to the side where a solid lies in nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.geometry.convex_solids import Solid, penetration

DIRECTIONS = 16
"""Compass directions that are tried, beside those in which the contacts push."""
STEPS = (0.0025, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.065, 0.08, 0.1, 0.13, 0.16, 0.2)
"""Distances that are tried [m], up to the largest that is allowed."""
CLEARANCE = 0.0005
"""Distance at which what is pushed out of a contact ends up [m]."""


@dataclass(frozen=True)
class Spot:
    """A place to the side."""

    offset: np.ndarray
    """(3,) level shift [m]."""
    depth: float
    """Sum of the penetrations that remain there [m], 0 when it is free."""


def remaining_depth(solid: Solid, others: Sequence[Solid], tolerance: float) -> float:
    """Return the sum of the penetrations [m] of a solid that are deeper than `tolerance` [m]."""
    depths = (penetration(solid, other).depth for other in others)
    return float(sum(depth for depth in depths if depth > tolerance))


def free_spot(
    solid: Solid,
    others: Sequence[Solid],
    allowed: Callable[[np.ndarray], bool],
    *,
    tolerance: float,
    maximum_shift: float,
) -> Spot:
    """Return the nearest level shift of at most `maximum_shift` [m] at which `solid` lies no deeper than `tolerance`
    [m] in any of the others; where none is free, the one that leaves least depth.

    `allowed(offset (2,))` says whether a shift may be made (whether the thing still stands on its support there).
    Directions: the compass, and those in which the contacts push; distances grow, so that the first free one is
    about the least (section 2.4.4 asks that nothing penetrates; min-conflicts can only exchange models for that).
    """
    in_reach = _within_reach(solid, others, maximum_shift)
    contacts = [contact for other in in_reach if (contact := penetration(solid, other)).depth > tolerance]
    if not contacts:
        return Spot(np.zeros(3), 0.0)
    best = Spot(np.zeros(3), float(sum(contact.depth for contact in contacts)))
    pushes = []
    for contact in contacts:
        flat = -contact.direction[:2]
        length = float(np.linalg.norm(flat))
        if length > 0.3:
            # Exactly out of this contact, which no round step is.
            pushes.append((flat / length, (contact.depth + CLEARANCE) / length))
    compass = [np.array([math.cos(a), math.sin(a)]) for a in 2 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS]
    tries = [(distance, direction) for direction, distance in pushes]
    tries += [(step, direction) for step in STEPS for direction in [*compass, *(push[0] for push in pushes)]]
    tries.sort(key=lambda entry: entry[0])
    for distance, direction in tries:
        if distance > maximum_shift:
            break
        if not allowed(distance * direction):
            continue
        offset = np.array([*(distance * direction), 0.0])
        depth = remaining_depth(solid.shifted(offset), in_reach, tolerance)
        if depth == 0.0:
            return Spot(offset, 0.0)
        if depth < best.depth:
            best = Spot(offset, depth)
    return best


def _within_reach(solid: Solid, others: Sequence[Solid], reach: float) -> list[Solid]:
    """Return the others whose bounds come within `reach` [m] of those of the solid."""
    if len(solid.objects) == 0:
        return []
    low, high = solid.low.min(axis=0) - reach, solid.high.max(axis=0) + reach
    return [
        other
        for other in others
        if len(other.objects) and np.all(other.low.min(axis=0) < high) and np.all(low < other.high.max(axis=0))
    ]

"""Which view to take next: the one that is expected to tell most for the time that it takes.

Of a thing, and of a corner of furniture where nothing was seen, it is asked whether it is what it is taken for. Views
of one region say the same; a view from another region is one more vote, wrong at a rate. What it is expected to tell is
the mutual information [bit] of that vote and of the truth. Of the floor, where something fell, a view is expected to
show the share of the places where it may lie that nobody looked at yet.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log2

import numpy as np
from scenewright.stages.agent.obstacle_map import CELL, OCCUPIED, ObstacleMap
from scenewright.stages.agent.scene_map import quarter
from scenewright.stages.agent.senses import Base

WRONG = 0.1
"""**Assumed** rate of wrong votes of a region."""
LOOK_SECONDS, SPEED = 10.0, 0.5
"""What a look takes, and how fast the base drives [m/s]: what views are chosen by, no clock goes by it."""
FALLS = 0.8
"""What falls off furniture lies this near to it [m]."""
ROLLS = 0.4
"""Distance from where a thing was lost at which it is e times less likely [m]; by eye."""
FLOOR_FROM, FLOOR_TO, FLOOR_ASIDE = 0.8, 1.9, 1.0
"""Distances from the base [m], and bearings off the middle [rad], of floor that three wrist poses show well."""
HEADINGS = 8
"""Headings at each place that are compared; by eye."""
Question = tuple[tuple[float, float], frozenset[int], int]
"""Where something is [m], quarter turns from which it was looked at, regions by which what it is taken for is ahead."""


def entropy(p: float) -> float:
    """Return the entropy of a yes of probability p [bit]."""
    return 0.0 if p in (0.0, 1.0) else -p * log2(p) - (1 - p) * log2(1 - p)


def vote_information(ahead: int, wrong: float = WRONG) -> float:
    """Return what one more vote tells [bit] about whether a class is right that is `ahead` by so many votes.

    Each vote multiplies the odds by (1 - wrong) / wrong; I(truth; vote) = H(vote) - H(vote | truth).
    """
    right = 1 / (1 + (wrong / (1 - wrong)) ** ahead)
    return entropy(right * (1 - wrong) + (1 - right) * wrong) - entropy(wrong)


def worth(base: Base, way: float, questions: Sequence[Question]) -> float:
    """Return what a look from a base pose is expected to tell, over its time [bit/s]; `way` [m]: to there."""
    information = sum(
        vote_information(ahead) for at, sides_seen, ahead in questions if quarter(base, at) not in sides_seen
    )
    return information / (LOOK_SECONDS + way / SPEED)


def fallen_where(
    obstacles: ObstacleMap, centre: tuple[float, float], size: tuple[float, float], spot: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return cells (N, 2) [m] around furniture where a thing may lie that was lost at a spot, and how likely each is
    (N,), which sum to 1; what is occupied, as by the furniture itself, is left out."""
    window, origin = obstacles.window, np.array(obstacles.origin)
    cells = np.argwhere(window != OCCUPIED) * CELL + origin
    out = np.maximum(np.abs(cells - centre) - np.array(size) / 2, 0.0)
    cells = cells[(out.max(axis=1) > 0) & (np.hypot(*out.T) <= FALLS)]
    weights = np.exp(-np.hypot(*(cells - np.array(spot[:2])).T) / ROLLS)
    return cells, weights / weights.sum() if len(weights) else weights


def floor_seen(obstacles: ObstacleMap, base: Base, cells: np.ndarray) -> np.ndarray:
    """Return (N,) bool: cells (N, 2) [m] of the floor that the wrist camera shows from a base pose, its yaw the middle
    of the three pictures: near enough, and nothing occupied on the line to them but where it ends."""
    offset = cells - (base.x, base.y)
    away = np.hypot(*offset.T)
    aside = np.abs((np.arctan2(offset[:, 1], offset[:, 0]) - base.yaw + np.pi) % (2 * np.pi) - np.pi)
    in_view = (away >= FLOOR_FROM) & (away <= FLOOR_TO) & (aside <= FLOOR_ASIDE)
    window, origin = obstacles.window, np.array(obstacles.origin)
    steps = np.linspace(0.0, 1.0, round(FLOOR_TO / CELL) + 1)
    points = (base.x, base.y) + offset[:, None] * steps[None, :, None]
    rows = np.clip(np.rint((points - origin) / CELL).astype(int), 0, np.array(window.shape) - 1)
    on_the_way = away[:, None] * (1 - steps) > 1.5 * CELL
    blocked = ((window[rows[..., 0], rows[..., 1]] == OCCUPIED) & on_the_way).any(axis=1)
    return np.asarray(in_view & ~blocked)


def best_floor_view(
    obstacles: ObstacleMap, here: Base, cells: np.ndarray, likely: np.ndarray
) -> tuple[Base, float] | None:
    """Return the base pose from which a look at the floor shows most of where a thing may lie, for the time that it
    takes, and how likely it shows it; None where no pose shows any. `likely` (N,): of cells (N, 2) [m], 0 where
    somebody looked already."""
    field, origin = obstacles.distances_from(here.x, here.y), np.array(obstacles.origin)
    rows = np.argwhere(np.isfinite(field) & obstacles.drivable)
    rows = rows[(rows % 3 == 0).all(axis=1)]
    places = [(0.0, here.x, here.y)] + [
        (float(field[i, j]), float(x), float(y)) for (i, j), (x, y) in zip(rows, rows * CELL + origin, strict=True)
    ]
    viewpoints = [p for p in places if len(cells) and np.hypot(*(cells - p[1:]).T).min() < FLOOR_TO]
    best: tuple[float, Base, float] | None = None
    for distance, x, y in viewpoints:
        for k in range(HEADINGS):
            base = Base(x, y, 2 * np.pi * k / HEADINGS - np.pi)
            shows = float(likely[floor_seen(obstacles, base, cells)].sum())
            value = shows / (LOOK_SECONDS + distance / SPEED)
            if shows > 0 and (best is None or value > best[0]):
                best = value, base, shows
    return None if best is None else best[1:]


def ahead_of(base: Base, far: float) -> tuple[float, float]:
    """Return the point [m] so far before a base pose."""
    return base.x + far * float(np.cos(base.yaw)), base.y + far * float(np.sin(base.yaw))

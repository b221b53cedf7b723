"""Objects that hang from above: a lamp from the ceiling (what Han 2024, section 2.6.5, leaves out)."""

from __future__ import annotations

import numpy as np
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.support import Candidate
from scipy.spatial import cKDTree

NEIGHBOURHOOD = 0.5
"""The ceiling over an object is what lies within this ground distance of its middle [m]; the object hides the rest."""
LEAST_POINTS = 10
"""With fewer points of the ceiling around, its height is that of the whole ceiling; by eye."""


def ceiling_height(ceiling: Entity, at: np.ndarray) -> float | None:
    """Return the height [m] of a ceiling over the ground point `at` (2,): the median of what was seen around it, else
    of all of it. None without points."""
    if not len(ceiling.points):
        return None
    neighbours = cKDTree(ceiling.points[:, :2]).query_ball_point(at, NEIGHBOURHOOD)
    heights = ceiling.points[neighbours, 2] if len(neighbours) >= LEAST_POINTS else ceiling.points[:, 2]
    return float(np.median(heights))


def hanging_candidate(child: Entity, ceilings: list[Entity], limit: float) -> Candidate | None:
    """Return the relation `hangs_from` of the nearest ceiling whose gap over the child's top is at most `limit` [m].

    The confidence falls from 1 at contact to 0.5 at the limit, as on a wall (`wall_candidate`).
    """
    over = [(ceiling_height(ceiling, np.asarray(child.box.center[:2])), ceiling) for ceiling in ceilings]
    gaps = [(abs(height - child.top), ceiling.instance, ceiling.name) for height, ceiling in over if height is not None]
    in_reach = [entry for entry in gaps if entry[0] <= limit]
    if not in_reach:
        return None
    gap, _, name = min(in_reach)
    confidence = 1.0 - 0.5 * gap / limit if limit > 0 else 1.0
    return Candidate(child.name, name, confidence, "hangs_from", gap, 0.0, child.top, None)

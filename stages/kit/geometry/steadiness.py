"""Whether a thing of which the camera saw a part would stand: a front falls on its face, a top without legs drops."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scenewright.stages.kit.geometry.solids import hull_or_box, mass_properties
from shapely.geometry import MultiPoint, Point, Polygon

LEAST_TILT = math.radians(5.0)
"""A floor may slope by this much [rad] before it tips over. Of the fronts seen in the recorded living room, and of what
stood in five generated rooms, none was between 1.5 and 20 degrees."""
FOOT_THICKNESS = 0.01
"""What ends so far above the ground [m], or nearer, touches it."""


def stands_steadily(pieces: Sequence[np.ndarray], rests_at: float) -> bool:
    """Whether convex pieces, corners (N, 3) [m] each, z up, would together stand on a floor at height `rests_at` [m]
    that slopes by five degrees."""
    corners = np.concatenate(pieces)
    outline = MultiPoint(corners[corners[:, 2] <= rests_at + FOOT_THICKNESS, :2]).convex_hull
    if not isinstance(outline, Polygon):
        return False
    solids = [hull_or_box(piece) for piece in pieces]
    center = mass_properties(solids, [1.0] * len(solids)).center
    above = Point(center[:2])
    margin = outline.exterior.distance(above) if outline.contains(above) else 0.0
    return bool(margin >= math.tan(LEAST_TILT) * (center[2] - rests_at))

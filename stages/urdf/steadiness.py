"""Whether furniture of which the camera saw a part would stand: a front falls on its face, a top without legs drops."""

from __future__ import annotations

import math

import numpy as np
from scenewright.stages.kit.formats.scene_supports import FOOT_THICKNESS, furniture_pieces
from scenewright.stages.kit.geometry.solids import hull_or_box, mass_properties
from shapely.geometry import MultiPoint, Point, Polygon

LEAST_TILT = math.radians(5.0)
"""A floor may slope by this much [rad] before it tips over. Of the fronts seen in the recorded living room, and of what
stood in five generated rooms, none was between 1.5 and 20 degrees."""


def stands_steadily(points: np.ndarray, faces: np.ndarray, rests_at: float) -> bool:
    """Whether what is seen of a thing, filled, would stand on a floor at height `rests_at` [m] that slopes by five
    degrees. Its mesh is (V, 3) [m], z up, and (F, 3); its shape is that of furniture in physics."""
    pieces = furniture_pieces(points, faces, rests_at)
    foot = np.concatenate(pieces)
    outline = MultiPoint(foot[foot[:, 2] <= rests_at + FOOT_THICKNESS, :2]).convex_hull
    if not isinstance(outline, Polygon):
        return False
    solids = [hull_or_box(piece) for piece in pieces]
    center = mass_properties(solids, [1.0] * len(solids)).center
    above = Point(center[:2])
    margin = outline.exterior.distance(above) if outline.contains(above) else 0.0
    return bool(margin >= math.tan(LEAST_TILT) * (center[2] - rests_at))

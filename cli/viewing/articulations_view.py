"""Articulations: the leaf of every part in both of its states, its axis, and the places that changed."""

from __future__ import annotations

import math

import numpy as np
from scenewright.schemas.articulations import Articulation, Articulations
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.viewing.canvas import Canvas

BEFORE, AFTER, AXIS = (0.12, 0.47, 0.71), (1.0, 0.5, 0.05), (0.84, 0.15, 0.16)
"""Colours of the outlines before and after, and of the axis (sRGB, 0 to 1)."""
CHANGED = np.array([150, 150, 150], np.uint8)
"""Colour of changed points (sRGB, of 255)."""
AXIS_LENGTH = 0.3
"""Half of what is drawn of an axis [m]."""


def draw_articulations(articulations: Articulations, canvas: Canvas) -> None:
    """Draw what moved: first state blue, second orange, axis red."""
    (points,) = read_arrays(articulations.path("changes.npz"), "points")
    if len(points):
        canvas.enclose(points.min(axis=0), points.max(axis=0))
        canvas.points("changed", points, np.tile(CHANGED, (len(points), 1)))
    for number, each in enumerate(articulations.info.articulations, start=1):
        origin, axis = np.array(each.origin), np.array(each.axis)
        strips = [_closed(each.leaf), _closed(each.leaf_after), origin + np.outer([-AXIS_LENGTH, AXIS_LENGTH], axis)]
        canvas.line(f"joint_{number}", strips, [BEFORE, AFTER, AXIS], labels=["before", "after", said(each)])


def said(each: Articulation) -> str:
    """Return kind and travel in words."""
    if each.type == "revolute":
        return f"turned by {math.degrees(each.travel):.0f} degrees"
    return f"slid by {100 * each.travel:.0f} cm"


def _closed(corners: tuple[tuple[float, float, float], ...]) -> np.ndarray:
    return np.array([*corners, corners[0]])

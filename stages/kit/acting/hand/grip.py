"""What every grasp of two fingers is made of: how far they reach, what lies between them, how a hand is turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FINGER_DEPTH = 0.032
"""How far the tool point can go in behind the front of an item before the palm touches it [m]."""
FINGER_BAND = 0.011
"""Half the breadth of a finger tip [m]: what lies within it is between the fingers."""
PITCHES = (0.0, 0.35, 0.7, 1.1, np.pi / 2)
"""How steeply a hand comes, from the side first [rad]; by eye."""


@dataclass(frozen=True)
class Grasp:
    """A pose of the tool relative to the item. Tool: z out of the hand, y along which the fingers close."""

    body_from_tool: np.ndarray
    width: float
    """Extent of the item between the fingers [m]."""
    pitch: float
    """Downward tilt of the approach: 0 from the side, pi/2 from above [rad]."""


def hand_axes(heading: float, pitch: float) -> np.ndarray:
    """Return the axes (3, 3) of a tool, as columns, that comes along a heading, `pitch` downwards [rad], and closes
    level."""
    approach = np.array([np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), -np.sin(pitch)])
    closing = np.array([-np.sin(heading), np.cos(heading), 0.0])
    return np.column_stack([np.cross(closing, approach), closing, approach])


def narrowest_width(points: np.ndarray) -> float:
    """Return the smallest horizontal extent [m] of points (N, 3) over all directions: why no grasp was found."""
    directions = np.linspace(0, np.pi, 36, endpoint=False)
    along = points[:, :2] @ np.array([np.cos(directions), np.sin(directions)])
    return float((along.max(axis=0) - along.min(axis=0)).min())

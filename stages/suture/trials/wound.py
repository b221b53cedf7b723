"""The raised wound: where the stitches go, and what a tip's path through it comes to.

The cross-section of the ridge is half an ellipse on the flat pad. Entry and exit lie on its flanks at such a distance
that 45 degrees of the needle's arc span it, which is what makes the thesis's rotation carry the tip from one to the
other. Sutures go away from the cameras, so that the thread of those before lies on the side to which it is swept.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt

import numpy as np
from scenewright.stages.suture.rig import NEEDLE_RADIUS

SPANNED = pi / 4
"""Arc of the needle between entry and exit [rad]."""
CHORD = 2.0 * NEEDLE_RADIUS * sin(SPANNED / 2)
"""Distance between entry and exit [m]."""
RIDGE_HALF_WIDTH, RIDGE_HEIGHT = 0.005, 0.005
"""Half the wound's width and its height [m]; half an ellipse, by eye."""
HOLE_HEIGHT = RIDGE_HEIGHT * sqrt(1.0 - (CHORD / 2 / RIDGE_HALF_WIDTH) ** 2)
"""Height of entry and exit on the wound [m]."""
SPACING, FIRST = 0.005, 0.0125
"""Distance between two sutures along the wound, and place of the first [m]."""
SUTURES = 6
"""Sutures of a wound."""
SLIDES_OFF = cos(np.radians(75.0))
"""Cosine of the angle between tip and inward surface normal beyond which the tip slides along the flank."""
SIDEWAYS = 0.0025
"""A hole farther than this along the wound [m] from its place is another stitch's."""
LOWEST = 0.0004
"""Holes lower than this [m] are in the pad, not in the wound."""


def entry(suture: int) -> np.ndarray:
    """Return the entry point (3,) [m] of suture 0 to 5, on the right driver's flank."""
    return np.array([-CHORD / 2, FIRST - SPACING * suture, HOLE_HEIGHT])


def exit_(suture: int) -> np.ndarray:
    """Return the exit point (3,) [m] of suture 0 to 5, on the left driver's flank."""
    return np.array([CHORD / 2, FIRST - SPACING * suture, HOLE_HEIGHT])


def inside(points: np.ndarray) -> np.ndarray:
    """Whether points (N, 3) lie in the ridge or in the pad."""
    ridge = (points[:, 0] / RIDGE_HALF_WIDTH) ** 2 + (points[:, 2] / RIDGE_HEIGHT) ** 2 < 1.0
    return ridge | (points[:, 2] < 0.0)


@dataclass(frozen=True)
class Passage:
    """What the tip's path came to: `fault` is None or says why it is an insertion error; holes (3,) where there are."""

    fault: str | None
    entered: np.ndarray | None = None
    left: np.ndarray | None = None


def passage(tips: np.ndarray, directions: np.ndarray, suture: int) -> Passage:
    """Judge the path of the tip (N, 3) [m] with its pointing directions (N, 3) by the thesis's insertion errors.

    Not through the raised edge, into a region that is not the wound, or out through the top or the bottom.
    """
    within = inside(tips)
    if not within.any():
        return Passage("the tip missed the raised edge")
    first = int(np.argmax(within))
    hole = tips[first]
    if hole[2] < LOWEST or hole[0] > 0.0 or abs(hole[1] - entry(suture)[1]) > SIDEWAYS:
        return Passage("the tip entered a region that is not the wound", hole)
    inward = -np.array([hole[0] / RIDGE_HALF_WIDTH**2, 0.0, hole[2] / RIDGE_HEIGHT**2])
    if directions[first] @ (inward / np.linalg.norm(inward)) < SLIDES_OFF:
        return Passage("the tip slid off the raised edge", hole)
    after = ~within[first:]
    if not after.any():
        return Passage("the tip stayed in the phantom", hole)
    out = tips[first + int(np.argmax(after))]
    if out[0] < RIDGE_HALF_WIDTH / 2:
        return Passage("the needle left the wound through its top", hole, out)
    if out[2] < LOWEST:
        return Passage("the needle left the wound at its bottom", hole, out)
    if abs(out[1] - exit_(suture)[1]) > SIDEWAYS:
        return Passage("the needle came out at another stitch's place", hole, out)
    if (inside(tips[first + int(np.argmax(after)) :])).any() or np.linalg.norm(tips[-1] - out) < 0.003:
        return Passage("too little of the needle came out", hole, out)
    return Passage(None, hole, out)

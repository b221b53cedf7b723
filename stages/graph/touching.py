"""Contact at the bottom of an object: what it touches there carries it, whatever lies deeper.

(2.3) measures gaps in metres, so that the table 6 cm below a box costs next to nothing, and (2.2) asks how much of the
footprint lies over the plane, which is hidden where it matters: under the object, and, seen from one side, behind it.
Both are mended with what a camera does see, the foot of the object and the surface right before it.
"""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.graph.nodes import Entity, Patch
from scenewright.stages.kit.geometry.boxes import footprint_overlap
from scipy.spatial import cKDTree

SINKING = 0.01
"""An object touches planes that are at most this far above its bottom (noise) [m]."""
REACHING = 0.02
"""An object touches planes that are at most this far below its bottom [m]. What is cut off from below by things before
it ends below their tops, not above."""
FOOT_HEIGHT = 0.015
"""Points within this height over the bottom belong to the foot [m]."""
SEAM = 0.025
"""A point of the foot stands on a plane when one of the plane's points is this near it along the ground [m]: two cells
of the grid on which surfaces are sampled, and what the borders of masks lose."""
FOOT_POINTS = 3
"""With fewer points at its bottom a thing has no foot; by eye."""
STEEPEST = 1.0
"""Tangent of the angle by which cameras that look at things on tables look down, at most."""


def touches(gap: float) -> bool:
    """Whether a plane `gap` [m] below an object's bottom can be in contact with it."""
    return -SINKING <= gap <= REACHING


def seam_share(child: Entity, patch: Patch) -> float:
    """Return the share of the foot of an object along which the seen surface of a plane reaches up to it; 0 without
    points."""
    foot = child.points[child.points[:, 2] <= child.bottom + FOOT_HEIGHT, :2]
    if len(foot) < FOOT_POINTS or not len(patch.points):
        return 0.0
    distance, _ = cKDTree(patch.points[:, :2]).query(foot, distance_upper_bound=SEAM)
    return float(np.isfinite(distance).mean())


def hidden_reach(child: Box, parent: Box) -> float:
    """Return how far below the bottom of a child [m] the top of a parent may seem to end, because the child juts out
    over it and hides its upper part from a camera that looks down by STEEPEST at most.

    The jut is the larger difference of their edges, long to long and short to short: the child may lie to one side.
    """
    juts = np.sort(np.asarray(child.size[:2])) - np.sort(np.asarray(parent.size[:2]))
    return REACHING + STEEPEST * max(0.0, float(juts.max()))


def smaller_share(child: Box, parent: Box) -> float:
    """Return the area that two footprints share over the area of the smaller one: a board may lie on a narrow post."""
    smaller = min(float(np.prod(child.size[:2])), float(np.prod(parent.size[:2])))
    return float(min(1.0, footprint_overlap(child, parent) / smaller)) if smaller > 0.0 else 0.0

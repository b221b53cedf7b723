"""Whether a placed model really bears what stands on one of its planes: the rectangle of a round table's top is no
table at its corners."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.cad.model_surfaces import ModelSurface, to_model
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.geometry.boxes import footprint

REACH = 0.005
"""Surface this near below a point bears it [m]."""
SPREAD = 0.6
"""Share to which the corners of a thing's footprint are drawn in; there and in its middle it is asked whether it is
borne."""
STEP = 0.01
"""Distance between two shifts that are tried [m]; by eye."""
FARTHEST = 0.3
"""Longest shift towards the middle of the plane [m]."""


def borne_share(parent: Placement, surface: ModelSurface, box: Box, height: float) -> float:
    """Return the share of five points below a thing with `box`, at `height` [m], that lie on the parent's surface."""
    ground = footprint(box)
    middle = ground.mean(axis=0)
    spots = np.concatenate([[middle], middle + SPREAD * (ground - middle)])
    points = np.column_stack([spots, np.full(len(spots), height)])
    gaps = parent.scale * surface.closest(to_model(parent, points), parent.shape.joints).distance
    return float(np.mean(gaps <= REACH))


def shift_to_bearing(
    parent: Placement, surface: ModelSurface, box: Box, height: float, middle: np.ndarray
) -> np.ndarray:
    """Return the least shift (2,) [m] towards `middle` (2,), the middle of the plane, at which all five points are
    borne; no shift when they are, or when none of at most `FARTHEST` does better."""
    best_share, best = borne_share(parent, surface, box, height), np.zeros(2)
    to_middle = np.asarray(middle, dtype=float) - np.asarray(box.center[:2])
    length = float(np.linalg.norm(to_middle))
    for distance in np.arange(STEP, min(length, FARTHEST) + STEP / 2, STEP):
        if best_share >= 1.0:
            break
        shift = to_middle / length * distance
        center = (box.center[0] + shift[0], box.center[1] + shift[1], box.center[2])
        share = borne_share(parent, surface, box.model_copy(update={"center": center}), height)
        if share > best_share:
            best_share, best = share, shift
    return best

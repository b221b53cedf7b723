"""Whether a thing stands around another: what nobody named may be a container all the same. Ours."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.kit.geometry.boxes import bottom, top, transform_points_to_box

DIRECTIONS = 16
"""Directions from a thing in which a side is looked for."""
ENCLOSED = 0.5
"""Share of directions over which a thing is enclosed: a back and two sides, and not a back and one."""
FAR = 1.0
"""Farther surface is no side of what a thing stands in [m]."""
OVER_BOARD, LEAST_SIDE = 0.03, 0.1
"""Surface from and to these heights over a thing's foot is a side, or up to its top [m]: not the board it is on."""


def surrounded_share(points: np.ndarray, box: Box) -> float:
    """Return the share of directions, seen from above, in which surface (N, 3) [m] stands beside a box."""
    low, high = bottom(box) + OVER_BOARD, max(top(box), bottom(box) + LEAST_SIDE)
    beside = points[(points[:, 2] > low) & (points[:, 2] < high)]
    within = (np.abs(transform_points_to_box(box, beside))[:, :2] < np.array(box.size[:2]) / 2).all(axis=1)
    offset = (beside - np.asarray(box.center))[~within, :2]
    offset = offset[np.hypot(*offset.T) < FAR]
    angle = np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi)
    return len(np.unique(np.floor(angle * DIRECTIONS).astype(int) % DIRECTIONS)) / DIRECTIONS


def encloses(parent: Entity, child: Entity) -> bool:
    """Whether the parent's surface stands around more than half of the child."""
    return surrounded_share(parent.points, child.box) > ENCLOSED

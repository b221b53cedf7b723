"""What a joint is for, told from the shape and place of what it moves: door, drawer, lid, knob, lever or slide."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.cad_library import JointKind
from scenewright.schemas.scene_parts import Joint

UPRIGHT = 0.7
"""|z| of the axis beyond which it counts as vertical."""
KNOB_OFFSET = 0.3
"""A knob's middle lies at most this share of its reach off its own axis."""
KNOB_REACH, LEVER_REACH = 0.25, 0.15
"""Largest reach from the axis of a knob and of a lever, as shares of the diagonal of the model."""
LARGEST_REACH = 0.2
"""Longest reach of a lever [m]: the doors of a whole kitchen in one piece are no levers."""
SLIDING_DOOR = 0.3
"""A sliding door is thinner across its way than this share of its length along it; a drawer is not."""
PANEL_FLATNESS = 0.85
"""A lid is lower than this share of its smaller horizontal extent when closed; what stands higher is a door."""


def joint_kind(joint: Joint, part: np.ndarray, model: np.ndarray) -> JointKind:
    """Return what the joint is for.

    `part` (N, 3): corners of what it moves, `model` (M, 3): of the whole, both in the model frame at joint value 0 [m].
    A slide along the horizontal is a drawer, or a sliding door, upwards a lid that lifts off, else a `slide`. What
    turns about an axis through its own middle is a knob, another small thing that turns a lever; of the rest, what
    turns about a vertical axis or stands upright is a door, what lies flat a lid.
    """
    axis, origin = np.asarray(joint.axis, dtype=float), np.asarray(joint.origin, dtype=float)
    size = np.ptp(part, axis=0)
    middle = 0.5 * (part.min(axis=0) + part.max(axis=0))
    if joint.type == "prismatic":
        if abs(axis[2]) < UPRIGHT:
            direction = np.abs(axis[:2])
            thin = (
                size[:2] @ direction[::-1] < SLIDING_DOOR * (size[:2] @ direction)
                and size[2] > size[:2] @ direction[::-1]
            )
            return "door" if thin else "drawer"
        above = middle[2] > 0.5 * (model[:, 2].min() + model[:, 2].max())
        return "lid" if axis[2] > 0 and above else "slide"
    reach = float(_radii(part, origin, axis).max())
    offset = float(_radii(middle[None], origin, axis)[0])
    diagonal = float(np.linalg.norm(np.ptp(model, axis=0)))
    if offset <= KNOB_OFFSET * reach and reach <= min(KNOB_REACH * diagonal, LARGEST_REACH):
        return "knob"
    if reach <= min(LEVER_REACH * diagonal, LARGEST_REACH):
        return "lever"
    if abs(axis[2]) > UPRIGHT:
        return "door"
    return "lid" if size[2] <= PANEL_FLATNESS * min(size[0], size[1]) else "door"


def _radii(points: np.ndarray, origin: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the distances (N,) of points from the line through `origin` along the unit vector `axis`."""
    away = points - origin
    return np.linalg.norm(away - np.outer(away @ axis, axis), axis=1)

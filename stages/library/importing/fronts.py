"""Where an imported model looks: towards its doors and drawers, away from its back rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.kit.geometry.file_axes import Direction
from scenewright.stages.library.importing.placing import Part

FRONT_SHARE = 0.35
"""How far out of the middle, of the half extent, moving parts or a back rest lie to tell the front."""
DRAWER_LEVEL, DRAWER_WIDTH = 0.2, 0.3
"""A drawer slides level (|z| of its axis), and is wider than this share of its depth."""
BACKED = ("chair", "sofa", "bench", "toilet", "bed")


def told_front(parts: Sequence[Part], class_name: str) -> tuple[Direction, str] | None:
    """Return where the model looks (a horizontal axis of the frame the parts are in) and what tells it, or None.

    Doors and drawers lie at the front; the upper third of a chair, a sofa, a bed lies at its back.
    """
    points = np.concatenate([surface.vertices for part in parts for surface in part.surfaces])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), 1e-9)
    total = np.zeros(2)
    for part in parts[1:]:
        vertices = np.concatenate([surface.vertices for surface in part.surfaces])
        least, most = vertices.min(axis=0), vertices.max(axis=0)
        weight = float(np.linalg.norm(most - least))
        out = _drawer_direction(part, most - least)
        total += weight * (((0.5 * (least + most) - middle) / half)[:2] if out is None else out)
    weights = sum(
        float(np.linalg.norm(np.ptp(np.concatenate([s.vertices for s in p.surfaces]), axis=0))) for p in parts[1:]
    )
    if weights > 0:
        front = _dominant(total / weights)
        if front is not None:
            return front, "joints"
    if class_name in BACKED:
        corners = [surface.vertices[surface.faces] for part in parts for surface in part.surfaces]
        front = front_of_back_rest(np.concatenate(corners))
        if front is not None:
            return front, "back rest"
    return None


def front_of_back_rest(corners: np.ndarray) -> Direction | None:
    """Return where upright triangles (F, 3, 3) look, away from what rises at one side of them, or None."""
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), 1e-9)
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    centers = corners.mean(axis=1)
    upper = centers[:, 2] > low[2] + 0.7 * (high[2] - low[2])
    if doubled[upper].sum() <= 0:
        return None
    back = np.average(centers[upper], axis=0, weights=doubled[upper])
    return _dominant(-((back - middle) / half)[:2])


def _drawer_direction(part: Part, size: np.ndarray) -> np.ndarray | None:
    """Return the horizontal direction (2,) in which a drawer of this size (3,) comes out; None for other parts.

    A sliding door slides too, but it is thin across its way.
    """
    joint = part.joint
    if joint is None or joint.type != "prismatic" or abs(joint.axis[2]) > DRAWER_LEVEL:
        return None
    direction = np.abs(np.asarray(joint.axis[:2]))
    along, across = float(size[:2] @ direction), float(size[:2] @ direction[::-1])
    return np.asarray(joint.axis[:2]) if across > DRAWER_WIDTH * along else None


def _dominant(offset: np.ndarray) -> Direction | None:
    axis = int(np.argmax(np.abs(offset)))
    if abs(offset[axis]) < FRONT_SHARE or abs(offset[axis]) < 1.5 * abs(offset[1 - axis]):
        return None
    direction = [0.0, 0.0, 0.0]
    direction[axis] = float(np.sign(offset[axis]))
    return (direction[0], direction[1], direction[2])

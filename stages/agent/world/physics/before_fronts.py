"""Base poses before a front that is known, and before the sides of furniture whose front is not."""

from __future__ import annotations

from math import atan2, hypot

import numpy as np
from scenewright.stages.agent.world.physics.fronts import Front
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.motion.doors import body_from_moved, closing_direction

AWAYS, ASIDES = (0.85, 0.75, 0.65, 0.55), (0.0, 0.25, -0.25, 0.45, -0.45)
"""Distances before a side, and beside its middle, from which it is looked at [m], in the order in which they are
tried."""
OFFS = (0.0, 0.25, -0.25)
"""Distances beside the middle of a leaf from which it is pushed [m], in the order in which they are tried."""


def bases_before(front: Front) -> list[np.ndarray]:
    """Return base poses (3,) of the map from which the hand may get along with what moves, the likeliest first: before
    a drawer, and beside the way of a leaf on the handle's side."""
    at = np.array(front.joint.handle or (0.0, 0.0, 0.0))
    x = front.size[0] / 2
    if front.slides:
        spots = [(away, at[1] + aside) for aside in (0.0, 0.35, -0.35, 0.5, -0.5) for away in AWAYS]
    else:
        side = -front.joint.axis[2]
        offs = ((0.75, 0.15), (0.65, 0.25), (0.85, 0.1), (0.85, 0.3), (0.55, 0.35), (0.75, -0.05), (0.95, 0.15))
        spots = [(away, at[1] + side * aside) for away, aside in offs]
    bases = []
    for away, y in spots:
        standpoint, front_point = apply(front.map_from_front, np.array([(x + away, y, 0.0), (x, at[1], 0.0)]))
        bases.append(
            np.array(
                [standpoint[0], standpoint[1], atan2(front_point[1] - standpoint[1], front_point[0] - standpoint[0])]
            )
        )
    return bases


def bases_outside(front: Front) -> list[np.ndarray]:
    """Return base poses (3,) of the map on the outer side of an open leaf, as it stands now, from which it is pushed
    shut: beyond a right angle it is out of reach from before its furniture. None for a drawer."""
    joint = front.joint
    if front.slides or front.value == 0:
        return []
    y0, y1 = front.panel[:2]
    middle = np.array([front.size[0] / 2, (y0 + y1) / 2, 0.0])
    moved = front.map_from_front @ body_from_moved(joint, front.value)
    at, direction = apply(moved, middle[None])[0], moved[:3, :3] @ closing_direction(joint, middle)
    aside = np.array([-direction[1], direction[0]])
    spots = (at[:2] - away * direction[:2] + off * aside for off in OFFS for away in AWAYS)
    return [np.array([*spot, atan2(*(at[:2] - spot)[::-1])]) for spot in spots]


def sides_of(box: tuple[np.ndarray, np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the middles (2,) of the four sides of a box with their unit normals (2,)."""
    centre, half = (box[0] + box[1])[:2] / 2, (box[1] - box[0])[:2] / 2
    return [(centre + normal * half, normal) for normal in np.array([(1, 0), (-1, 0), (0, 1), (0, -1)], float)]


def before(middle: np.ndarray, normal: np.ndarray) -> list[np.ndarray]:
    """Return base poses (3,) from which a side (its middle and normal, (2,)) is looked at, the best first."""
    along_front = np.array([-normal[1], normal[0]])
    spots = (middle + away * normal + aside * along_front for aside in ASIDES for away in AWAYS)
    return [np.array([*spot, atan2(*(middle - spot)[::-1])]) for spot in spots]


def away_from(front: Front, base: np.ndarray) -> float:
    """Return the distance [m] of a base (3,) from the middle of the front."""
    base_in_front = front.local(np.array([[base[0], base[1], 0.0]]))[0]
    return hypot(base_in_front[0] - front.size[0] / 2, base_in_front[1])

"""Cabinets: a closed carcass, and before it doors and drawers, which the bars that stand out of its front tell."""

from __future__ import annotations

import numpy as np
from scenewright.stages.cad.families import open_cabinets
from scenewright.stages.cad.families.cabinet_parts import FRONT, GAP, boards, closed_leaf, plinth
from scenewright.stages.cad.families.forms import Form, Reading, box_piece
from scenewright.stages.cad.families.reading import bounds, in_own_frame, levels
from scenewright.stages.cad.front_bars import Front, front_of
from scenewright.stages.cad.front_leaves import FrontLeaf, leaves_of
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

LEAST_DEPTH, DEEPEST, LEAST_HEIGHT = 0.15, 0.8, 0.2
"""A cabinet is at least so deep, at most so deep where the wall behind it tells, and its front so high [m]."""
AGAINST = 0.1
"""A cabinet that ends so near to the wall behind it stands against it [m]: what is on its top hides its rear."""
SAME_TOP = 0.05
"""A front ends at the top where it ends so near to it [m]."""
LEAST_TOP = 0.04
"""Surface that is the top [m²]."""


def read(reading: Reading) -> Form | str:
    """Return the cabinet that a surface shows, shut or open, or why there is none."""
    shut = read_shut(reading)
    if reading.hangs:
        return shut
    form = open_cabinets.read(reading)
    if isinstance(shut, Form) and isinstance(form, Form):
        return max((shut, form), key=lambda each: each.explains(reading))
    if isinstance(shut, str) and isinstance(form, str):
        return f"{shut}; open: {form}"
    return form if isinstance(shut, str) else shut


def read_shut(reading: Reading) -> Form | str:
    """Return the cabinet with all leaves shut that a surface shows, or why there is none."""
    found = _from_the_front(in_own_frame(reading))
    if found is None:
        return "no bar stands out of a flat side of it"
    own, front = found
    leaves = leaves_of(front)
    if isinstance(leaves, str):
        return leaves
    (x0, x1), (z0, z1) = np.stack([front.low, front.high], axis=1)
    z1 = min((z for z in _tops(own) if abs(z - z1) < SAME_TOP), default=z1)
    inside = (own.patches.points[:, 0] > x0) & (own.patches.points[:, 0] < x1)
    rear = bounds(own.patches.points[inside, 1], own.patches.areas[inside])[1]
    wall = own.wall_behind(np.array([0.5 * (x0 + x1), front.level, 0.5 * (z0 + z1)]))
    if rear - front.level < LEAST_DEPTH and (wall is None or not LEAST_DEPTH < wall - front.level < DEEPEST):
        return "its depth was not seen, and no wall is behind it"
    if wall is not None and (rear - front.level < LEAST_DEPTH or 0.0 < wall - rear < AGAINST):
        rear = wall
    if z1 - z0 < LEAST_HEIGHT:
        return "its front is too low"
    whole = box_piece("cabinet", np.array([x0, front.level, z0]), np.array([x1, rear, z1]))
    if not own.has_room(whole):
        return "cameras saw that it is not full"
    carcass = np.array([x0, front.level + FRONT + GAP, z0]), np.array([x1, rear, z1])
    pieces = boards(*carcass) + ([] if own.hangs else plinth(*carcass, own.base))
    moving = tuple(closed_leaf(number, leaf, front.level, rear) for number, leaf in enumerate(leaves, 1))
    return Form("cabinet", _classes(leaves, z1 - own.base, hangs=own.hangs), tuple(pieces), own.turn, moving)


def _from_the_front(reading: Reading) -> tuple[Reading, Front] | None:
    """Return the reading turned so that the side with most of bars looks to -y, and that side below its top, the lowest
    level place: what is higher stands on it. None where no side has bars."""
    tops = _tops(reading)
    best: tuple[float, Reading, Front] | None = None
    for quarter in range(4):
        turn = transform_from_yaw(0.5 * np.pi * quarter, np.zeros(3))[:3, :3]
        turned = reading.turned(reading.turn @ turn)
        below = turned.patches.points[:, 2] < min(tops, default=np.inf)
        front = front_of(turned.patches.chosen(below))
        length = 0.0 if front is None else sum(float(np.max(bar.high - bar.low)) for bar in front.bars)
        if front is not None and length > (0.0 if best is None else best[0]):
            best = (length, turned, front)
    return None if best is None else best[1:]


def _tops(reading: Reading) -> list[float]:
    """Return the heights of level places that may be its top [m]."""
    return [z for z, area in levels(reading.patches) if area >= LEAST_TOP and z > reading.base + LEAST_HEIGHT]


def _classes(leaves: tuple[FrontLeaf, ...], height: float, *, hangs: bool) -> tuple[str, ...]:
    """Return what a cabinet may be called, the likeliest first."""
    if hangs:
        return ("wall_cabinet",)
    drawers = all(leaf.slides for leaf in leaves)
    if height > 1.5 and not drawers:
        return ("wardrobe", "cabinet")
    return ("cabinet", "drawer_unit") if drawers else ("cabinet",)

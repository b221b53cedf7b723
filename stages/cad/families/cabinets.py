"""Cabinets: a closed carcass, and before it doors and drawers, which the bars that stand out of its front tell."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scenewright.stages.cad.families.forms import Form, Leaf, Piece, Reading, box_piece
from scenewright.stages.cad.families.reading import bounds, in_own_frame, levels
from scenewright.stages.cad.front_bars import Front, front_of
from scenewright.stages.cad.front_leaves import FrontLeaf, leaves_of
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

LEAST_DEPTH, DEEPEST, LEAST_HEIGHT = 0.15, 0.8, 0.2
"""A cabinet is at least so deep, at most so deep where the wall behind it tells, and its front so high [m]."""
SAME_TOP = 0.05
"""A front ends at the top where it ends so near to it [m]."""
BOARD, FRONT, GAP, WALL = 0.018, 0.018, 0.002, 0.012
"""Thickness of boards, of fronts, and of what is behind a drawer's front, and how far a front is from its carcass [m];
by eye."""
RECESS = 0.05
"""A plinth is so far behind the front [m]; by eye."""
LEAST_TOP = 0.04
"""Surface that is the top [m²]."""
BAR, STANDOFF = 0.016, (0.03, 0.06)
"""Width of a bar, and between which distances from the front it is [m]: one grasps behind it."""
SWING, PULL = 0.5 * math.pi, 0.8
"""How far a door swings [rad], and a drawer slides, as a share of its depth: what is common, nobody saw it."""


def read(reading: Reading) -> Form | str:
    """Return the cabinet that a surface shows, or why there is none."""
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
    if rear - front.level < LEAST_DEPTH:
        wall = own.wall_behind(np.array([0.5 * (x0 + x1), front.level, 0.5 * (z0 + z1)]))
        if wall is None or not LEAST_DEPTH < wall - front.level < DEEPEST:
            return "its depth was not seen, and no wall is behind it"
        rear = wall
    if z1 - z0 < LEAST_HEIGHT:
        return "its front is too low"
    whole = box_piece("cabinet", np.array([x0, front.level, z0]), np.array([x1, rear, z1]))
    if not own.has_room(whole):
        return "cameras saw that it is not full"
    carcass = np.array([x0, front.level + FRONT + GAP, z0]), np.array([x1, rear, z1])
    pieces = _boards(*carcass) + ([] if own.hangs else _plinth(*carcass, own.base))
    moving = tuple(_leaf(number, leaf, front.level, rear) for number, leaf in enumerate(leaves, 1))
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


def _boards(low: np.ndarray, high: np.ndarray) -> list[Piece]:
    """Return the boards of a carcass between two corners (3,): what is behind and below is inferred."""
    inner_low, inner_high = low + (BOARD, 0, BOARD), high - (BOARD, 0, BOARD)

    def board(name: str, x: tuple[float, float], z: tuple[float, float], front: float, *, seen: bool) -> Piece:
        ends = np.array([x[0], front, z[0]]), np.array([x[1], high[1], z[1]])
        return box_piece(name, *ends, seen=seen, carries=name in ("top", "bottom"))

    across = (inner_low[0], inner_high[0])
    return [
        board("top", (low[0], high[0]), (inner_high[2], high[2]), low[1], seen=True),
        board("side", (low[0], inner_low[0]), (low[2], inner_high[2]), low[1], seen=True),
        board("side", (inner_high[0], high[0]), (low[2], inner_high[2]), low[1], seen=True),
        board("bottom", across, (low[2], inner_low[2]), low[1], seen=False),
        board("back", across, (inner_low[2], inner_high[2]), high[1] - BOARD, seen=False),
    ]


def _plinth(low: np.ndarray, high: np.ndarray, base: float) -> list[Piece]:
    if low[2] - base < BOARD:
        return []
    ends = np.array([low[0] + BOARD, min(low[1] + RECESS, 0.5 * (low[1] + high[1])), base])
    return [box_piece("plinth", ends, np.array([high[0] - BOARD, high[1], low[2]]), seen=False)]


def _leaf(number: int, leaf: FrontLeaf, level: float, rear: float) -> Leaf:
    """Return a leaf before the carcass, with its bar; behind a drawer's front its box."""
    low = np.array([leaf.low[0] + GAP / 2, level, leaf.low[1] + GAP / 2])
    high = np.array([leaf.high[0] - GAP / 2, level + FRONT, leaf.high[1] - GAP / 2])
    middle = 0.5 * (low + high)
    standoff = float(np.clip(leaf.bar.height, *STANDOFF))
    handle = np.array([leaf.bar.middle[0], level - standoff, leaf.bar.middle[1]])
    along = 2 if leaf.bar.standing else 0
    pieces = [box_piece("front", low, high), *_bar(leaf, handle, along, level)]
    if leaf.slides:
        depth = rear - BOARD - GAP - level
        pieces += _drawer(low, high, level + FRONT, level + depth)
        origin, axis, travel = middle, np.array([0.0, -1.0, 0.0]), PULL * depth
    else:
        side = high[0] if leaf.hinge_right else low[0]
        origin = np.array([side, level + FRONT, middle[2]])
        axis, travel = np.array([0.0, 0.0, 1.0 if leaf.hinge_right else -1.0]), SWING
    kind = "drawer" if leaf.slides else "door"
    joint_type: Literal["revolute", "prismatic"] = "prismatic" if leaf.slides else "revolute"
    return Leaf(
        f"{kind}_{number}", joint_type, tuple(pieces), origin, axis, travel, handle, np.eye(3)[along], leaf.seen
    )


def _bar(leaf: FrontLeaf, handle: np.ndarray, along: int, level: float) -> list[Piece]:
    """Return the bar of a leaf on its two posts."""
    size = leaf.bar.high - leaf.bar.low
    half = np.full(3, 0.5 * BAR)
    half[along] = max(0.5 * float(np.max(size)), BAR)
    pieces = [box_piece("bar", handle - half, handle + half)]
    for sign in (-1.0, 1.0):
        post = np.full(3, 0.5 * BAR)
        low, high = handle - post, handle + post
        low[along] = high[along] = handle[along] + sign * (half[along] - 0.5 * BAR)
        low[along] -= 0.5 * BAR
        high[along] += 0.5 * BAR
        low[1], high[1] = handle[1] + 0.5 * BAR, level
        pieces.append(box_piece("post", low, high))
    return pieces


def _drawer(low: np.ndarray, high: np.ndarray, front: float, rear: float) -> list[Piece]:
    """Return bottom and walls of a drawer behind its front (corners `low`, `high`), between two depths [m]."""
    x0, x1 = low[0] + 2 * BOARD, high[0] - 2 * BOARD
    z0, z1 = low[2] + BOARD + GAP, high[2] - 2 * BOARD
    spans = [
        ((x0, front, z0), (x1, rear, z0 + WALL)),
        ((x0, front, z0 + WALL), (x0 + WALL, rear, z1)),
        ((x1 - WALL, front, z0 + WALL), (x1, rear, z1)),
        ((x0 + WALL, rear - WALL, z0 + WALL), (x1 - WALL, rear, z1)),
    ]
    boxes = [(np.array(first), np.array(last)) for first, last in spans]
    return [box_piece("drawer", a, b, seen=False) for a, b in boxes if np.all(b - a > 1e-3)]


def _classes(leaves: tuple[FrontLeaf, ...], height: float, *, hangs: bool) -> tuple[str, ...]:
    """Return what a cabinet may be called, the likeliest first."""
    if hangs:
        return ("wall_cabinet",)
    drawers = all(leaf.slides for leaf in leaves)
    if height > 1.5 and not drawers:
        return ("wardrobe", "cabinet")
    return ("cabinet", "drawer_unit") if drawers else ("cabinet",)

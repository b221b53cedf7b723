"""What cabinets are made of: a carcass of boards, a plinth, and leaves with their bars."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.stages.cad.families.forms import Leaf, Piece, box_piece
from scenewright.stages.cad.front_leaves import FrontLeaf

BOARD, FRONT, GAP, WALL = 0.018, 0.018, 0.002, 0.012
"""Thickness of boards, of fronts, and of what is behind a drawer's front, and how far a front is from its carcass [m];
by eye."""


@dataclass(frozen=True)
class Thickness:
    """Of the walls of a carcass [m]."""

    left: float = BOARD
    right: float = BOARD
    back: float = BOARD


THIN = Thickness()
RECESS = 0.05
"""A plinth is so far behind the front [m]; by eye."""
BAR, STANDOFF = 0.016, (0.03, 0.06)
"""Width of a bar, and between which distances from the front it is [m]: one grasps behind it."""
SWING, PULL = 0.5 * math.pi, 0.8
"""How far a door swings [rad], and a drawer slides, as a share of its depth: what is common, nobody saw it."""


def boards(low: np.ndarray, high: np.ndarray, thick: Thickness = THIN) -> list[Piece]:
    """Return the boards of a carcass between two corners (3,): what is behind and below is inferred."""
    x0, x1, rear = low[0] + thick.left, high[0] - thick.right, high[1] - thick.back
    z0, z1 = low[2] + BOARD, high[2] - BOARD
    spans: dict[str, list[tuple[tuple[float, float, float], tuple[float, float, float]]]] = {
        "top": [((low[0], low[1], z1), (high[0], high[1], high[2]))],
        "side": [((low[0], low[1], low[2]), (x0, high[1], z1)), ((x1, low[1], low[2]), (high[0], high[1], z1))],
        "bottom": [((x0, low[1], low[2]), (x1, high[1], z0))],
        "back": [((x0, rear, z0), (x1, high[1], z1))],
    }
    return [
        box_piece(name, np.array(a), np.array(b), seen=name in ("top", "side"), carries=name in ("top", "bottom"))
        for name, each in spans.items()
        for a, b in each
    ]


def plinth(low: np.ndarray, high: np.ndarray, base: float) -> list[Piece]:
    if low[2] - base < BOARD:
        return []
    ends = np.array([low[0] + BOARD, min(low[1] + RECESS, 0.5 * (low[1] + high[1])), base])
    return [box_piece("plinth", ends, np.array([high[0] - BOARD, high[1], low[2]]), seen=False)]


def closed_leaf(number: int, leaf: FrontLeaf, level: float, rear: float) -> Leaf:
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

"""Ours: leaves of a built-in, where the log shows a face of it move; the joint is the one that was seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scenewright.schemas.articulations import Articulation
from scenewright.stages.cad.carcasses import Cells

STRAIGHT = 0.95
"""Cosine from which on a leaf that was seen lies in a side of the carcass."""
REACH = 0.05
"""Largest distance between a leaf and the side of the carcass that it closes [m]."""
THICKNESS, RIM, BOARD = 0.02, 0.015, 0.012
"""Thickness of a leaf, what it covers of the carcass around its opening, and thickness of a drawer's boards [m]."""
DEEPEST, BEHIND = 0.55, 0.02
"""An opening is so deep at most, and leaves so much of the carcass [m]."""
LEAST_DEPTH = 0.1
"""A shallower carcass has nothing behind a leaf [m]."""

Span = tuple[np.ndarray, np.ndarray]
"""Low and high corner (3,) of a box [m]."""


@dataclass(frozen=True)
class BuiltInLeaf:
    """A part that moves. Frame of the cells."""

    boxes: tuple[Span, ...]
    """Shut: the front, and for a drawer its bottom and sides."""
    type: Literal["revolute", "prismatic"]
    axis: np.ndarray
    """(3,) opens by a positive value."""
    origin: np.ndarray
    """(3,) [m]."""
    travel: float
    """How far it was seen open [rad] or [m]."""
    value: float
    """As it is in the map."""


@dataclass(frozen=True)
class _Shut:
    """A side of the carcass in which a leaf lies."""

    axis: int
    up: bool
    level: float


def leaves_of(
    cells: Cells, world_from_cells: np.ndarray, articulations: Sequence[Articulation]
) -> tuple[Cells, tuple[BuiltInLeaf, ...]]:
    """Return the carcass with openings, and the leaves before them. `world_from_cells`: rotation (3, 3)."""
    leaves = []
    for entry in articulations:
        first, second = (np.array(corners) @ world_from_cells for corners in (entry.leaf, entry.leaf_after))
        shut_sides = [(shut, corners) for corners in (first, second) if (shut := _side(cells, corners)) is not None]
        if not shut_sides:
            continue
        if len(shut_sides) == 2 and entry.type == "prismatic":  # a drawer's front looks the same way drawn out
            side = shut_sides[0][0]
            out = 1.0 if side.up else -1.0
            opening = out * (second - first).mean(axis=0)[side.axis] > 0
            side, corners = shut_sides[0 if opening else 1]
        else:
            side, corners = shut_sides[0]
            opening = corners is first
        axis = np.asarray(entry.axis) @ world_from_cells
        if opening and _square(second):
            cells = cells.without(second.min(axis=0) - 2 * THICKNESS, second.max(axis=0) + 2 * THICKNESS)
        opened = _cut_opening(cells, side, corners, drawer=entry.type == "prismatic")
        if opened is None:
            continue
        cells, boxes = opened
        leaf = BuiltInLeaf(
            boxes,
            entry.type,
            axis if opening else -axis,
            np.asarray(entry.origin) @ world_from_cells,
            entry.travel,
            entry.travel if opening else 0.0,
        )
        leaves.append(leaf)
    return cells, tuple(leaves)


def shifted(leaf: BuiltInLeaf, by: np.ndarray) -> BuiltInLeaf:
    """Return a leaf moved by (3,) [m]."""
    boxes = tuple((low + by, high + by) for low, high in leaf.boxes)
    return replace(leaf, boxes=boxes, origin=leaf.origin + by)


def _normal(corners: np.ndarray) -> np.ndarray:
    cross = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    return cross / max(float(np.linalg.norm(cross)), 1e-12)


def _square(corners: np.ndarray) -> bool:
    """Whether a rectangle lies across an axis."""
    return bool(np.abs(_normal(corners)).max() > STRAIGHT)


def _side(cells: Cells, corners: np.ndarray) -> _Shut | None:
    """Return the upright side of the carcass that a rectangle (4, 3) lies in, the nearest; None where there is none."""
    normal, middle = np.abs(_normal(corners)), corners.mean(axis=0)
    axis = int(np.argmax(normal))
    if axis == 2 or normal[axis] < STRAIGHT:
        return None
    others = [a for a in range(3) if a != axis]
    sides_near = []
    for up in (False, True):
        for low, high in cells.sides(axis, up):
            far = abs(low[axis] - middle[axis])
            if far <= REACH and np.all(middle[others] > low[others]) and np.all(middle[others] < high[others]):
                sides_near.append((far, up, float(low[axis])))
    return None if not sides_near else _Shut(axis, min(sides_near)[1], min(sides_near)[2])


def _cut_opening(
    cells: Cells, side: _Shut, corners: np.ndarray, *, drawer: bool
) -> tuple[Cells, tuple[Span, ...]] | None:
    """Return the carcass with an opening, and the boxes of the leaf before it; None where nothing is behind it."""
    axis, inwards = side.axis, -1.0 if side.up else 1.0
    others = [a for a in range(3) if a != axis]
    whole_low, whole_high = (np.array([c[k] for c in cells.cuts]) for k in (0, -1))
    low, high = np.maximum(corners.min(axis=0), whole_low), np.minimum(corners.max(axis=0), whole_high)
    room = (side.level - whole_low[axis]) if side.up else (whole_high[axis] - side.level)
    depth = min(DEEPEST, float(room) - BEHIND)
    if depth < LEAST_DEPTH or np.any((high - low)[others] < 3 * RIM):
        return None

    def span(start: float, end: float, rim: float) -> Span:
        """From `start` to `end` [m] behind the side, the leaf's outline less a rim."""
        a, b = low + rim, high - rim
        ends = sorted((side.level + inwards * start, side.level + inwards * end))
        a[axis], b[axis] = ends
        return a, b

    front, hollow = span(0.0, THICKNESS, 0.0), span(0.0, depth, RIM)
    opened = cells.without(*front).without(*hollow)
    boxes = [front]
    if drawer:
        inner = span(THICKNESS, depth - BEHIND, RIM + 0.005)
        across = others[0]  # the level one of the two
        bottom, left, right = ([edge.copy() for edge in inner] for _ in range(3))
        bottom[1][2] = bottom[0][2] + BOARD
        left[1][across] = left[0][across] + BOARD
        right[0][across] = right[1][across] - BOARD
        boxes += [(a, b) for a, b in (bottom, left, right) if np.all(b - a > 1e-3)]
    return opened, tuple(boxes)

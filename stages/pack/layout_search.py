"""Places for rectangles at quarter turns in a rectangle: depth-first over touching positions, with restarts, compiled.

Each box is tried where it touches the container, an obstacle, a box that is there already, or the rim of what the robot
reaches (the corner positions of Martello, Pisinger & Vigo 2000, Operations Research 48(2)); with few boxes and enough
nodes this is an exact search over those positions. What the hand needs around a box counts as part of it, against what
is higher than the hand comes. Budgets count nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled

BOX, X, Y, TURN, HALF_SIDE = 0, 1, 2, 3, 4
"""Columns of placements: number of the box, its centre [m], quarter turns (0 or 1); half side [m] of the square around
a refused one."""
PLACED_X, PLACED_Y, PLACED_TURN = 0, 1, 2
"""Columns of the places (B, 3) of all boxes; a turn below 0: none yet."""
SCORE, ROW_X, ROW_Y, ROW_TURN = 0, 1, 2, 3
"""Columns of the positions that are tried of a box, the least score first."""
LOW_X, LOW_Y, HIGH_X, HIGH_Y = 0, 1, 2, 3
"""Columns of rectangles."""
NODES = 500
"""Most nodes of one search; by eye."""
RESTARTS = 16
"""Searches with other orders; by eye."""
HAND_GAP, TOUCH_GAP = 0.001, 0.0011
"""Gap between the hand and what it must not hit, and gap at which positions are tried [m]; by eye."""
DENSEST = 0.97
"""Share of the container beyond which no layout is looked for."""


class LayoutProblem(NamedTuple):
    """B boxes, F fixed rectangles, K footprints of parts of the hand. Rectangles: low x, low y, high x, high y [m]. The
    compiled functions take it as it is."""

    extents: np.ndarray
    """(B, 2) width and length."""
    container: np.ndarray
    """(4,)"""
    fixed: np.ndarray
    """(F, 4) obstacles."""
    hand: np.ndarray
    """(2, K, 4) footprints of the hand's parts about the tool, at yaw 0 and a quarter turn."""
    over_fixed: np.ndarray
    """(B, F, K) bool: part k of the hand that places box b would hit fixed f."""
    over_boxes: np.ndarray
    """(B, B, K) bool: part k of the hand that places the first box would hit the second, which stands already."""
    reach: float
    """Largest distance of a centre from the origin [m]."""
    refused: np.ndarray
    """(T, 5) placements not to try again, see BOX, X, Y, TURN, HALF_SIDE."""
    preset: np.ndarray = np.zeros((0, 4))
    """(P, 4) boxes that have their place, see BOX, X, Y, TURN."""


def find_layout(
    problem: LayoutProblem, gap: float, random: np.random.Generator, *, nodes: int = NODES, restarts: int = RESTARTS
) -> np.ndarray | None:
    """Return (B, 3) centre x, y [m] and turn (0, 1) of every box, `gap` [m] apart, or None when none was found."""
    if not _area_allows(problem, gap):
        return None
    area = problem.extents[:, 0] * problem.extents[:, 1]
    preset = {int(row[BOX]) for row in problem.preset}
    free = [box for box in range(len(area)) if box not in preset]
    for restart in range(restarts):
        weight = area * random.uniform(0.5, 1.5, len(area)) if restart else area
        order = np.array(sorted(free, key=lambda box: -weight[box]), dtype=np.int64)
        corner = restart % 4
        placed, done = _search(problem, order, gap, corner, nodes)
        if done == 1:
            return placed
    return None


def _area_allows(problem: LayoutProblem, gap: float) -> bool:
    """Whether boxes and gaps take up no more of the container than rectangles with gaps seldom exceed."""
    low_x, low_y, high_x, high_y = problem.container
    free = (high_x - low_x + gap) * (high_y - low_y + gap)
    for fixed in problem.fixed:
        sides = np.minimum(fixed[2:], problem.container[2:]) - np.maximum(fixed[:2], problem.container[:2])
        free -= float(np.prod(np.maximum(sides, 0.0)))
    return float(np.prod(problem.extents + gap, axis=1).sum()) <= DENSEST * free


class _Rectangle(NamedTuple):
    """Low and high corner [m]."""

    low_x: float
    low_y: float
    high_x: float
    high_y: float


@compiled
def _apart(first, second, gap):  # type: ignore[no-untyped-def]
    """Whether rectangles are at least `gap` apart along an axis."""
    return (
        first.high_x + gap <= second.low_x + 1e-9
        or second.high_x + gap <= first.low_x + 1e-9
        or first.high_y + gap <= second.low_y + 1e-9
        or second.high_y + gap <= first.low_y + 1e-9
    )


@compiled
def _row(rectangles, row):  # type: ignore[no-untyped-def]
    """Return one of (F, 4) rectangles."""
    return _Rectangle(rectangles[row, LOW_X], rectangles[row, LOW_Y], rectangles[row, HIGH_X], rectangles[row, HIGH_Y])


@compiled
def _box_at(extents, box, x, y, turn):  # type: ignore[no-untyped-def]
    """Return what a box covers with its centre at (x, y)."""
    half_x, half_y = extents[box, turn] / 2, extents[box, 1 - turn] / 2
    return _Rectangle(x - half_x, y - half_y, x + half_x, y + half_y)


@compiled
def _hand_at(hand, part, x, y, turn):  # type: ignore[no-untyped-def]
    """Return what a part of the hand covers that holds a box at (x, y)."""
    return _Rectangle(
        x + hand[turn, part, LOW_X],
        y + hand[turn, part, LOW_Y],
        x + hand[turn, part, HIGH_X],
        y + hand[turn, part, HIGH_Y],
    )


@compiled
def _may_stand(problem, placed, box, x, y, turn, gap):  # type: ignore[no-untyped-def]
    """Whether a box may stand at (x, y) beside those that are `placed` (B, 3)."""
    footprint = _box_at(problem.extents, box, x, y, turn)
    if (
        footprint.low_x < problem.container[LOW_X] - 1e-9
        or footprint.low_y < problem.container[LOW_Y] - 1e-9
        or footprint.high_x > problem.container[HIGH_X] + 1e-9
        or footprint.high_y > problem.container[HIGH_Y] + 1e-9
    ):
        return False
    if x * x + y * y > problem.reach * problem.reach:
        return False
    for row in range(problem.refused.shape[0]):
        same = int(problem.refused[row, BOX]) == box and int(problem.refused[row, TURN]) == turn
        half_side = problem.refused[row, HALF_SIDE]
        if same and abs(problem.refused[row, X] - x) < half_side and abs(problem.refused[row, Y] - y) < half_side:
            return False
    for f in range(problem.fixed.shape[0]):
        obstacle = _row(problem.fixed, f)
        if not _apart(footprint, obstacle, gap):
            return False
        for k in range(problem.hand.shape[1]):
            if problem.over_fixed[box, f, k] and not _apart(_hand_at(problem.hand, k, x, y, turn), obstacle, HAND_GAP):
                return False
    for placed_box in range(placed.shape[0]):
        if placed[placed_box, PLACED_TURN] < 0:
            continue
        there_x, there_y, turned = (
            placed[placed_box, PLACED_X],
            placed[placed_box, PLACED_Y],
            int(placed[placed_box, PLACED_TURN]),
        )
        stands = _box_at(problem.extents, placed_box, there_x, there_y, turned)
        if not _apart(footprint, stands, gap):
            return False
        for k in range(problem.hand.shape[1]):
            if problem.over_boxes[box, placed_box, k] and not _apart(
                _hand_at(problem.hand, k, x, y, turn), stands, HAND_GAP
            ):
                return False
            if problem.over_boxes[placed_box, box, k] and not _apart(
                _hand_at(problem.hand, k, there_x, there_y, turned), footprint, HAND_GAP
            ):
                return False
    return True


@compiled
def _lines(problem, placed, box, turn, axis, gap, out):  # type: ignore[no-untyped-def]
    """Write the centre coordinates along an axis (0: x, 1: y) at which the box touches something into `out`; return how
    many."""
    half = (problem.extents[box, turn] if axis == 0 else problem.extents[box, 1 - turn]) / 2
    count = 0
    out[count] = problem.container[axis] + half
    out[count + 1] = problem.container[axis + 2] - half
    count += 2
    for f in range(problem.fixed.shape[0]):
        out[count] = problem.fixed[f, axis + 2] + gap + half
        out[count + 1] = problem.fixed[f, axis] - gap - half
        count += 2
        for k in range(problem.hand.shape[1]):
            if problem.over_fixed[box, f, k]:
                out[count] = problem.fixed[f, axis + 2] - problem.hand[turn, k, axis] + TOUCH_GAP
                out[count + 1] = problem.fixed[f, axis] - problem.hand[turn, k, axis + 2] - TOUCH_GAP
                count += 2
    for placed_box in range(placed.shape[0]):
        if placed[placed_box, PLACED_TURN] < 0:
            continue
        turned = int(placed[placed_box, PLACED_TURN])
        reach = (problem.extents[placed_box, turned] if axis == 0 else problem.extents[placed_box, 1 - turned]) / 2
        out[count] = placed[placed_box, axis] + reach + gap + half
        out[count + 1] = placed[placed_box, axis] - reach - gap - half
        count += 2
        for k in range(problem.hand.shape[1]):
            if problem.over_boxes[box, placed_box, k]:
                out[count] = placed[placed_box, axis] + reach - problem.hand[turn, k, axis] + TOUCH_GAP
                out[count + 1] = placed[placed_box, axis] - reach - problem.hand[turn, k, axis + 2] - TOUCH_GAP
                count += 2
            if problem.over_boxes[placed_box, box, k]:
                out[count] = placed[placed_box, axis] + problem.hand[turned, k, axis + 2] + half + TOUCH_GAP
                out[count + 1] = placed[placed_box, axis] + problem.hand[turned, k, axis] - half - TOUCH_GAP
                count += 2
    return count


@compiled
def _candidates(problem, placed, box, gap, corner, rows):  # type: ignore[no-untyped-def]
    """Write the allowed touching positions into `rows` (N, 4), best first; return how many."""
    extents, fixed, hand, reach = problem.extents, problem.fixed, problem.hand, problem.reach
    over_fixed, over_boxes = problem.over_fixed, problem.over_boxes
    size = 4 + 2 * (fixed.shape[0] + placed.shape[0]) * (1 + 2 * hand.shape[1])
    xs, ys = np.empty(size), np.empty(size)
    count = 0
    needs_hand = False
    for f in range(fixed.shape[0]):
        for k in range(hand.shape[1]):
            needs_hand = needs_hand or over_fixed[box, f, k]
    for placed_box in range(placed.shape[0]):
        for k in range(hand.shape[1]):
            needs_hand = needs_hand or over_boxes[box, placed_box, k] or over_boxes[placed_box, box, k]
    turns = 1 if abs(extents[box, 0] - extents[box, 1]) < 1e-6 and not needs_hand else 2
    for turn in range(turns):
        half_x, half_y = extents[box, turn] / 2, extents[box, 1 - turn] / 2
        m = _lines(problem, placed, box, turn, 1, gap, ys)
        n = _lines(problem, placed, box, turn, 0, gap, xs)
        for j in range(m):
            y = ys[j]
            extra = n
            if np.isfinite(reach) and reach > abs(y):
                xs[n] = np.sqrt(reach * reach - y * y) - 1e-6
                extra = n + 1
            for i in range(extra):
                x = xs[i]
                if count < rows.shape[0] and _may_stand(problem, placed, box, x, y, turn, gap):
                    # Near the robot first; ties towards the side that the restart prefers.
                    low_edge = x - half_x
                    side = y - half_y if corner % 2 == 0 else -(y + half_y)
                    rows[count, SCORE] = low_edge + 0.3 * side if corner < 2 else 0.3 * low_edge + side
                    rows[count, ROW_X], rows[count, ROW_Y], rows[count, ROW_TURN] = x, y, turn
                    count += 1
    order = np.argsort(rows[:count, SCORE])
    sorted_rows = rows[:count][order]
    distinct = 0
    for row in range(count):
        same = False
        for earlier in range(distinct):
            if (
                abs(rows[earlier, ROW_X] - sorted_rows[row, ROW_X]) < 1e-6
                and abs(rows[earlier, ROW_Y] - sorted_rows[row, ROW_Y]) < 1e-6
                and rows[earlier, ROW_TURN] == sorted_rows[row, ROW_TURN]
            ):
                same = True
                break
        if not same:
            rows[distinct] = sorted_rows[row]
            distinct += 1
    return distinct


@compiled
def _search(problem, order, gap, corner, nodes):  # type: ignore[no-untyped-def]
    """Depth first over `order`; return places (B, 3) and 1: found, 0: out of nodes, -1: there is none."""
    preset = problem.preset
    placed = np.full((problem.extents.shape[0], 3), -1.0)
    for row in range(preset.shape[0]):
        box, turn = int(preset[row, BOX]), int(preset[row, TURN])
        if not _may_stand(problem, placed, box, preset[row, X], preset[row, Y], turn, 0.0):
            return placed, -1
        placed[box, PLACED_X], placed[box, PLACED_Y], placed[box, PLACED_TURN] = preset[row, X], preset[row, Y], turn
    depth_count = len(order)
    if depth_count == 0:
        return placed, 1
    width = 600
    rows = np.empty((depth_count, width, 4))
    counts = np.zeros(depth_count, dtype=np.int64)
    at = np.zeros(depth_count, dtype=np.int64)
    depth = 0
    used = 0
    counts[0] = _candidates(problem, placed, order[0], gap, corner, rows[0])
    while depth >= 0:
        box = order[depth]
        placed[box, PLACED_TURN] = -1.0
        if at[depth] >= counts[depth]:
            depth -= 1
            continue
        used += 1
        if used > nodes:
            return placed, 0
        row = rows[depth, at[depth]]
        at[depth] += 1
        placed[box, PLACED_X], placed[box, PLACED_Y] = row[ROW_X], row[ROW_Y]
        placed[box, PLACED_TURN] = row[ROW_TURN]
        if depth + 1 == depth_count:
            return placed, 1
        depth += 1
        at[depth] = 0
        counts[depth] = _candidates(problem, placed, order[depth], gap, corner, rows[depth])
    return placed, -1

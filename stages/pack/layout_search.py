"""Places for rectangles at quarter turns in a rectangle: depth-first over touching positions, with restarts, compiled.

Each box is tried where it touches the container, an obstacle, a box that is there already, or the rim of what the robot
reaches (the corner positions of Martello, Pisinger & Vigo 2000, Operations Research 48(2)); with few boxes and enough
nodes this is an exact search over those positions. What the hand needs around a box counts as part of it, against what
is higher than the hand comes. Budgets count nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

UNPLACED = -1
NODES = 500
RESTARTS = 16
DENSEST = 0.97
"""Share of the container beyond which no layout is looked for."""


@dataclass(frozen=True)
class LayoutProblem:
    """B boxes, F fixed rectangles, K footprints of parts of the hand. Rectangles: low x, low y, high x, high y [m]."""

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
    """(T, 5) placements not to try again: box, x, y, turn, half side [m] of the square around them."""
    preset: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    """(P, 4) boxes that have their place: box, x, y, turn (0 or 1)."""


def find_layout(
    problem: LayoutProblem, gap: float, random: np.random.Generator, *, nodes: int = NODES, restarts: int = RESTARTS
) -> np.ndarray | None:
    """Return (B, 3) centre x, y [m] and turn (0, 1) of every box, `gap` [m] apart, or None when none was found."""
    if not _area_allows(problem, gap):
        return None
    area = problem.extents[:, 0] * problem.extents[:, 1]
    preset = {int(row[0]) for row in problem.preset}
    free = [box for box in range(len(area)) if box not in preset]
    for restart in range(restarts):
        weight = area * random.uniform(0.5, 1.5, len(area)) if restart else area
        order = np.array(sorted(free, key=lambda box: -weight[box]), dtype=np.int64)
        corner = restart % 4
        placed, done = _search(
            problem.extents, problem.container, problem.fixed, problem.hand, problem.over_fixed, problem.over_boxes,
            problem.reach, problem.refused, problem.preset, order, gap, corner, nodes,
        )  # fmt: skip
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


@njit(cache=True)
def _apart(ax, ay, bx, by, cx, cy, dx, dy, gap):  # type: ignore[no-untyped-def]
    """Whether rectangles (ax, ay, bx, by) and (cx, cy, dx, dy) are at least `gap` apart along an axis."""
    return bx + gap <= cx + 1e-9 or dx + gap <= ax + 1e-9 or by + gap <= cy + 1e-9 or dy + gap <= ay + 1e-9


@njit(cache=True)
def _allowed(extents, container, fixed, hand, over_fixed, over_boxes, reach, refused, placed, box, x, y, turn, gap):  # type: ignore[no-untyped-def]
    half_x = extents[box, turn] / 2
    half_y = extents[box, 1 - turn] / 2
    ax, ay, bx, by = x - half_x, y - half_y, x + half_x, y + half_y
    if ax < container[0] - 1e-9 or ay < container[1] - 1e-9 or bx > container[2] + 1e-9 or by > container[3] + 1e-9:
        return False
    if x * x + y * y > reach * reach:
        return False
    for row in range(refused.shape[0]):
        same = int(refused[row, 0]) == box and int(refused[row, 3]) == turn
        if same and abs(refused[row, 1] - x) < refused[row, 4] and abs(refused[row, 2] - y) < refused[row, 4]:
            return False
    for f in range(fixed.shape[0]):
        if not _apart(ax, ay, bx, by, fixed[f, 0], fixed[f, 1], fixed[f, 2], fixed[f, 3], gap):
            return False
        for k in range(hand.shape[1]):
            if over_fixed[box, f, k] and not _apart(
                x + hand[turn, k, 0], y + hand[turn, k, 1], x + hand[turn, k, 2], y + hand[turn, k, 3],
                fixed[f, 0], fixed[f, 1], fixed[f, 2], fixed[f, 3], 0.001,
            ):  # fmt: skip
                return False
    for other in range(placed.shape[0]):
        if placed[other, 2] < 0:
            continue
        ox, oy, turned = placed[other, 0], placed[other, 1], int(placed[other, 2])
        ohx, ohy = extents[other, turned] / 2, extents[other, 1 - turned] / 2
        if not _apart(ax, ay, bx, by, ox - ohx, oy - ohy, ox + ohx, oy + ohy, gap):
            return False
        for k in range(hand.shape[1]):
            if over_boxes[box, other, k] and not _apart(
                x + hand[turn, k, 0], y + hand[turn, k, 1], x + hand[turn, k, 2], y + hand[turn, k, 3],
                ox - ohx, oy - ohy, ox + ohx, oy + ohy, 0.001,
            ):  # fmt: skip
                return False
            if over_boxes[other, box, k] and not _apart(
                ox + hand[turned, k, 0], oy + hand[turned, k, 1], ox + hand[turned, k, 2], oy + hand[turned, k, 3],
                ax, ay, bx, by, 0.001,
            ):  # fmt: skip
                return False
    return True


@njit(cache=True)
def _lines(container, fixed, hand, over_fixed, over_boxes, extents, placed, box, axis, half, turn, gap, out):  # type: ignore[no-untyped-def]
    """Write the centre coordinates along an axis at which the box touches something into `out`; return how many."""
    count = 0
    out[count] = container[axis] + half
    out[count + 1] = container[axis + 2] - half
    count += 2
    for f in range(fixed.shape[0]):
        out[count] = fixed[f, axis + 2] + gap + half
        out[count + 1] = fixed[f, axis] - gap - half
        count += 2
        for k in range(hand.shape[1]):
            if over_fixed[box, f, k]:
                out[count] = fixed[f, axis + 2] - hand[turn, k, axis] + 0.0011
                out[count + 1] = fixed[f, axis] - hand[turn, k, axis + 2] - 0.0011
                count += 2
    for other in range(placed.shape[0]):
        if placed[other, 2] < 0:
            continue
        turned = int(placed[other, 2])
        reach = (extents[other, turned] if axis == 0 else extents[other, 1 - turned]) / 2
        out[count] = placed[other, axis] + reach + gap + half
        out[count + 1] = placed[other, axis] - reach - gap - half
        count += 2
        for k in range(hand.shape[1]):
            if over_boxes[box, other, k]:
                out[count] = placed[other, axis] + reach - hand[turn, k, axis] + 0.0011
                out[count + 1] = placed[other, axis] - reach - hand[turn, k, axis + 2] - 0.0011
                count += 2
            if over_boxes[other, box, k]:
                out[count] = placed[other, axis] + hand[turned, k, axis + 2] + half + 0.0011
                out[count + 1] = placed[other, axis] + hand[turned, k, axis] - half - 0.0011
                count += 2
    return count


@njit(cache=True)
def _candidates(  # type: ignore[no-untyped-def]
    extents, container, fixed, hand, over_fixed, over_boxes, reach, refused, placed, box, gap, corner, rows
):
    """Write (score, x, y, turn) of the allowed touching positions into `rows`, best first; return how many."""
    size = 4 + 2 * (fixed.shape[0] + placed.shape[0]) * (1 + 2 * hand.shape[1])
    xs, ys = np.empty(size), np.empty(size)
    count = 0
    needs_hand = False
    for f in range(fixed.shape[0]):
        for k in range(hand.shape[1]):
            needs_hand = needs_hand or over_fixed[box, f, k]
    for other in range(placed.shape[0]):
        for k in range(hand.shape[1]):
            needs_hand = needs_hand or over_boxes[box, other, k] or over_boxes[other, box, k]
    turns = 1 if abs(extents[box, 0] - extents[box, 1]) < 1e-6 and not needs_hand else 2
    for turn in range(turns):
        half_x, half_y = extents[box, turn] / 2, extents[box, 1 - turn] / 2
        m = _lines(container, fixed, hand, over_fixed, over_boxes, extents, placed, box, 1, half_y, turn, gap, ys)
        n = _lines(container, fixed, hand, over_fixed, over_boxes, extents, placed, box, 0, half_x, turn, gap, xs)
        for j in range(m):
            y = ys[j]
            extra = n
            if np.isfinite(reach) and reach > abs(y):
                xs[n] = np.sqrt(reach * reach - y * y) - 1e-6
                extra = n + 1
            for i in range(extra):
                x = xs[i]
                if count < rows.shape[0] and _allowed(
                    extents, container, fixed, hand, over_fixed, over_boxes, reach, refused, placed, box, x, y, turn,
                    gap,
                ):  # fmt: skip
                    # Near the robot first; ties towards the side that the restart prefers.
                    near = x - half_x
                    side = y - half_y if corner % 2 == 0 else -(y + half_y)
                    rows[count, 0] = near + 0.3 * side if corner < 2 else 0.3 * near + side
                    rows[count, 1], rows[count, 2], rows[count, 3] = x, y, turn
                    count += 1
    order = np.argsort(rows[:count, 0])
    sorted_rows = rows[:count][order]
    kept = 0
    for row in range(count):
        same = False
        for earlier in range(kept):
            if (
                abs(rows[earlier, 1] - sorted_rows[row, 1]) < 1e-6
                and abs(rows[earlier, 2] - sorted_rows[row, 2]) < 1e-6
                and rows[earlier, 3] == sorted_rows[row, 3]
            ):
                same = True
                break
        if not same:
            rows[kept] = sorted_rows[row]
            kept += 1
    return kept


@njit(cache=True)
def _search(extents, container, fixed, hand, over_fixed, over_boxes, reach, refused, preset, order, gap, corner, nodes):  # type: ignore[no-untyped-def]
    """Depth first over `order`; return places (B, 3) and 1: found, 0: out of nodes, -1: there is none."""
    placed = np.full((extents.shape[0], 3), -1.0)
    for row in range(preset.shape[0]):
        box, turn = int(preset[row, 0]), int(preset[row, 3])
        if not _allowed(
            extents, container, fixed, hand, over_fixed, over_boxes, reach, refused, placed, box, preset[row, 1],
            preset[row, 2], turn, 0.0,
        ):  # fmt: skip
            return placed, -1
        placed[box, 0], placed[box, 1], placed[box, 2] = preset[row, 1], preset[row, 2], turn
    depth_count = len(order)
    if depth_count == 0:
        return placed, 1
    width = 600
    rows = np.empty((depth_count, width, 4))
    counts = np.zeros(depth_count, dtype=np.int64)
    at = np.zeros(depth_count, dtype=np.int64)
    depth = 0
    used = 0
    counts[0] = _candidates(
        extents, container, fixed, hand, over_fixed, over_boxes, reach, refused, placed, order[0], gap, corner, rows[0]
    )
    while depth >= 0:
        box = order[depth]
        placed[box, 2] = -1.0
        if at[depth] >= counts[depth]:
            depth -= 1
            continue
        used += 1
        if used > nodes:
            return placed, 0
        row = rows[depth, at[depth]]
        at[depth] += 1
        placed[box, 0], placed[box, 1], placed[box, 2] = row[1], row[2], row[3]
        if depth + 1 == depth_count:
            return placed, 1
        depth += 1
        at[depth] = 0
        counts[depth] = _candidates(
            extents, container, fixed, hand, over_fixed, over_boxes, reach, refused, placed, order[depth], gap, corner,
            rows[depth],
        )  # fmt: skip
    return placed, -1

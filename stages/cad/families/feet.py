"""What a thing on one column stands on: the arms of a star that were seen, or the least foot that holds it.

Ours. Stars were seen on generated rooms alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cad.families.forms import Piece, Reading, box_piece
from scenewright.stages.cad.families.reading import ASIDE, EVERYWHERE
from scenewright.stages.kit.geometry.steadiness import stands_steadily
from scipy.ndimage import label

FEET, FOOT = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0), 0.03
"""Widths of a foot that nobody saw, as shares of the top's, and its height [m]."""
COLUMN = 0.08
"""Width of a column that nobody saw [m]; by eye."""
LOW = 0.15
"""A star is surface around a column that is no higher than this [m]."""
OUTER = 0.6
"""The tips of its arms are surface from this share of its reach on."""
TIP, LEAST_TIP, FEWEST = 0.03, 0.002, 3
"""Surface of a tip is no farther apart [m]; a tip has so much of it at least [m²], and a star so many arms; by eye."""
ARM = 0.03
"""Width of an arm, and of the castor under its tip [m]; by eye."""
SEEN = 0.6
"""Surface was seen along so much of an arm."""


def foot_below(board: Piece, posts: Sequence[Piece], reading: Reading) -> list[Piece]:
    """Return what a board stands on whose posts do not hold it: a star, else the least foot; nothing without room."""
    return star_below(board, posts, reading) or least_foot(board, posts, reading)


def star_below(board: Piece, posts: Sequence[Piece], reading: Reading) -> list[Piece]:
    """Return the arms of the star that was seen around the one column below the middle of a board, each with a castor
    down to the ground; nothing where fewer than three were seen.

    A map gives what is close to the floor to the floor, so that of castors hardly anything is left. Arms that nobody
    saw are where the others leave a gap, if there is room.
    """
    low, high = board.corners.min(axis=0)[:2], board.corners.max(axis=0)[:2]
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if len(posts) != 1 or np.any(np.abs(posts[0].corners[:, :2].mean(axis=0) - middle) > ASIDE * half):
        return []
    column = posts[0].corners[np.argsort(posts[0].corners[:, 2])[:4], :2]
    center, patches = column.mean(axis=0), reading.patches
    off, height = patches.points[:, :2] - center, patches.points[:, 2] - reading.base
    distance = np.linalg.norm(off, axis=1)
    around = (distance > 0.5 * np.ptp(column, axis=0).max() + 0.5 * ARM) & (height > 0) & (height < LOW)
    off, height, distance = off[around], height[around], distance[around]
    outer = distance > OUTER * np.percentile(distance, 95) if around.any() else around[:0]
    if not outer.any() or outer.all():
        return []
    tips = [tip for tip in _tips(off[outer], patches.areas[around][outer]) if _seen_along(off, tip) >= SEEN]
    if len(tips) < FEWEST:
        return []
    under, over = np.percentile(height[~outer], (5, 95))
    over_tip = np.percentile(height[outer], 95)
    at = np.array([*center, reading.base])

    def arm(tip: np.ndarray, seen: bool) -> list[Piece]:
        root = (1 - ARM / np.linalg.norm(tip)) * tip
        bars = ("arm", np.zeros(2), (under, over, under, over_tip)), ("castor", root, (0.0, under, 0.0, under))
        return [Piece(name, _bar(first, tip, heights) + at, seen) for name, first, heights in bars]

    unseen = [arm(tip, False) for tip in _missing(tips)]
    arms = [arm(tip, True) for tip in tips] + [some for some in unseen if all(map(reading.has_room, some))]
    return [piece for some in arms for piece in some]


def _missing(tips: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the tips (2,) that a star lacks: its arms are at equal angles, and as long."""
    angles = np.sort([np.arctan2(tip[1], tip[0]) for tip in tips])
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    counts = np.maximum(np.round(gaps / np.median(gaps)).astype(int), 1)
    reach = np.median([np.linalg.norm(tip) for tip in tips])
    turns = [a + gap * k / n for a, gap, n in zip(angles, gaps, counts, strict=True) for k in range(1, n)]
    return [reach * np.array([np.cos(turn), np.sin(turn)]) for turn in turns]


def _tips(points: np.ndarray, areas: np.ndarray) -> list[np.ndarray]:
    """Return the far ends (2,) of connected surface, points (N, 2) from the column, of `areas` (N,)."""
    cells = np.floor((points - points.min(axis=0)) / TIP).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    number, distance = label(grid, EVERYWHERE)[0][tuple(cells.T)], np.linalg.norm(points, axis=1)
    tips = []
    for k in np.unique(number):
        own = number == k
        if areas[own].sum() >= LEAST_TIP:
            reach = np.percentile(distance[own], 98)
            end = points[own & (distance > reach - ARM)].mean(axis=0)
            tips.append(reach / np.linalg.norm(end) * end)
    return tips


def _seen_along(points: np.ndarray, tip: np.ndarray) -> float:
    """Return along which share of the way to a tip (2,) there are points (N, 2) beside it."""
    reach = float(np.linalg.norm(tip))
    along = points @ tip / reach
    beside = (np.abs(points @ [-tip[1], tip[0]]) / reach < ARM) & (along > 0) & (along < reach)
    return len(np.unique((along[beside] / ARM).astype(int))) * ARM / reach


def _bar(first: np.ndarray, last: np.ndarray, heights: Sequence[float]) -> np.ndarray:
    """Return the corners (8, 3) of a bar from one place (2,) to another; `heights`: below and above, at both [m]."""
    along = (last - first) / np.linalg.norm(last - first)
    across = 0.5 * ARM * np.array([-along[1], along[0]])
    ends = ((first, heights[:2]), (last, heights[2:]))
    return np.array([[*(end + side * across), z] for end, zs in ends for side in (-1, 1) for z in zs])


def column_below(board: Piece, reading: Reading) -> list[Piece]:
    """Return the column below the middle of a board that nobody saw, where there is room: what has no legs has one."""
    middle, low = 0.5 * (board.corners.min(axis=0) + board.corners.max(axis=0))[:2], board.corners[:, 2].min()
    ends = np.array([*(middle - 0.5 * COLUMN), reading.base]), np.array([*(middle + 0.5 * COLUMN), low])
    column = box_piece("leg", *ends, seen=False)
    return [column] if reading.has_room(column) else []


def least_foot(board: Piece, above: Sequence[Piece], reading: Reading) -> list[Piece]:
    """Return the least foot below the middle of a board that holds it and what is `above`; nothing without room."""
    low, high = board.corners.min(axis=0)[:2], board.corners.max(axis=0)[:2]
    for share in FEET:
        half = 0.5 * share * (high - low)
        middle = 0.5 * (low + high)
        ends = np.array([*(middle - half), reading.base]), np.array([*(middle + half), reading.base + FOOT])
        foot = box_piece("foot", *ends, seen=False)
        if stands_steadily([board.corners, foot.corners, *(piece.corners for piece in above)], reading.base):
            return [foot] if reading.has_room(foot) else []
    return []

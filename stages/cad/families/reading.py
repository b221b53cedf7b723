"""What families read off a surface: level boards, the posts below them, slabs that stand, and what is left.

Every dimension comes from surface: heights from flat places, outlines from where these end, widths of posts from the
surface around them. What was not seen of a post's partners is mirrored about the middle of the board that they carry.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from scenewright.stages.cad.carcasses import ACROSS, Patches, flat_places, own_yaw
from scenewright.stages.cad.families.forms import APRON, Piece, Reading, box_piece
from scenewright.stages.kit.geometry.boxes import convex_hull, minimum_rectangle, polygon_area
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scipy.ndimage import binary_dilation, label

SAME_LEVEL = 0.02
"""Surface so near to a height is at it [m]: a voxel."""
BOARD, THICKEST, THINNEST = 0.03, 0.12, 0.015
"""Thickness of a board whose underside nobody saw, and the bounds of one that was seen [m]; by eye."""
APART = 0.05
"""Boards one over the other are at least so far apart [m]."""
UNDERSIDE = 0.05
"""An underside that was seen has at least this share of the top's area."""
RECTANGULAR = 0.9
"""An outline that fills this share of its rectangle is one: a disc fills 0.79."""
CELL, BIN = 0.05, 0.05
"""Posts are looked for in cells of this edge, and slices of this height [m]."""
UPRIGHT = 0.5
"""A post is seen in at least this share of the slices between the ground and where aprons are."""
LEAST_POST = 0.03
"""Width of a post of which one side was seen [m]."""
WIDTHS = (0.5, 0.2)
"""A post is as wide as the middle slice of it; where that has no room, as those that show least beside it."""
WIDER = 1.6
"""Slices in which a post is so many times wider than in the middle one hold a rail that meets it."""
ASIDE = 0.25
"""A post has a partner on the other side of the board's middle, from so much of its half width on."""
LEAN = 0.03
"""A post whose ends are farther apart sidewise leans [m]."""
LEFT_OVER, LEAST_LEFT, MOST_LEFT = 0.03, 0.015, 8
"""Surface so far from all pieces [m] is left over; in patches of at least so much [m²], it is further pieces, so many
at most."""
STICKS_OUT = 0.15
"""What sticks out farther [m] is of something else: masks leak."""
OUTER = 0.01
"""Share of the surface that may lie beyond either end of a piece."""
INSET = 0.25
"""A leg that nobody saw is no farther from its corner than this share of half the board; by eye."""
CORNER = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
EVERYWHERE = np.ones((3, 3), dtype=bool)


def level_rows(patches: Patches) -> np.ndarray:
    """Return (N,) bool: the patches that look up."""
    return patches.normals[:, 2] > ACROSS


def levels(patches: Patches) -> list[tuple[float, float]]:
    """Return (height [m], area [m²]) of the level places of a surface that look up, the largest first."""
    up = level_rows(patches)
    places = flat_places(patches.points[up, 2], patches.areas[up])
    return sorted(places, key=lambda place: -place[1])


def in_own_frame(reading: Reading) -> Reading:
    """Return a reading in the frame of its upright surface, or of its largest level place where that has a smaller
    rectangle there: the sides of round legs say nothing."""
    yaw = own_yaw(reading.patches)
    places = levels(reading.patches)
    if places:
        rows = level_rows(reading.patches) & (np.abs(reading.patches.points[:, 2] - places[0][0]) < SAME_LEVEL)
        level = reading.patches.points[rows, :2]
        if len(level) >= 4:
            angle = minimum_rectangle(level)[2]
            turned = level @ transform_from_yaw(yaw, np.zeros(3))[:2, :2]
            best = level @ transform_from_yaw(angle, np.zeros(3))[:2, :2]
            if np.prod(np.ptp(best, axis=0)) < 0.95 * np.prod(np.ptp(turned, axis=0)):
                yaw = angle
    return reading.turned(reading.turn @ transform_from_yaw(yaw, np.zeros(3))[:3, :3])


def along_x(reading: Reading) -> Reading:
    """Return a reading turned so that it is at least as long along x as along y: fronts look along -y."""
    x, y = (np.ptp(bounds(reading.patches.points[:, axis], reading.patches.areas)) for axis in (0, 1))
    quarter = transform_from_yaw(0.5 * np.pi, np.zeros(3))[:3, :3]
    return reading if x >= y else reading.turned(reading.turn @ quarter)


def bounds(values: np.ndarray, areas: np.ndarray) -> tuple[float, float]:
    """Return between where a surface lies along an axis, but for strays: values, areas (N,)."""
    order = np.argsort(values, kind="stable")
    share = np.cumsum(areas[order]) / areas.sum()
    first, last = np.searchsorted(share, [OUTER, 1 - OUTER])
    half = 0.5 * float(np.sqrt(2 * np.median(areas)))  # values are middles of triangles
    return float(values[order[first]]) - half, float(values[order[min(last, len(order) - 1)]]) + half


def board_at(name: str, height: float, patches: Patches) -> Piece | None:
    """Return the board whose top lies at a height [m]: a rectangle, or a disc and the like; None where too little is
    there to have an outline."""
    rows = np.flatnonzero(level_rows(patches) & (np.abs(patches.points[:, 2] - height) < SAME_LEVEL))
    rows = rows[_connected(patches.points[rows, :2])] if len(rows) else rows
    if len(rows) < 4:
        return None
    here = patches.chosen(rows)
    top = float(np.average(here.points[:, 2], weights=here.areas))
    x, y = (bounds(here.points[:, axis], here.areas) for axis in (0, 1))
    low, high = np.array([x[0], y[0]]), np.array([x[1], y[1]])
    thick = _thickness(patches, low, high, top, float(here.areas.sum()))
    inside = here.points[np.all((here.points[:, :2] >= low) & (here.points[:, :2] <= high), axis=1), :2]
    outline = convex_hull(inside) if len(inside) >= 4 else np.zeros((0, 2))
    if len(outline) >= 3 and polygon_area(outline) < RECTANGULAR * float(np.prod(np.ptp(inside, axis=0))):
        corners = np.concatenate([np.column_stack([outline, np.full(len(outline), z)]) for z in (top - thick, top)])
        return Piece(name, corners, True, (np.array([*low, top]), np.array([*high, top])))
    return box_piece(name, np.array([*low, top - thick]), np.array([*high, top]), carries=True)


def _connected(points: np.ndarray) -> np.ndarray:
    """Return (N,) bool: level points (N, 2) of the largest connected place, and of others a quarter as large."""
    cells = np.floor((points - points.min(axis=0)) / CELL).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    number = label(binary_dilation(grid, EVERYWHERE), EVERYWHERE)[0][tuple(cells.T)]
    counts = np.bincount(number)
    return np.asarray(counts[number] >= 0.25 * counts.max())


def _thickness(patches: Patches, low: np.ndarray, high: np.ndarray, top: float, area: float) -> float:
    """Return how thick a board is [m], by its underside; `low`, `high` (2,)."""
    inside = np.all((patches.points[:, :2] > low) & (patches.points[:, :2] < high), axis=1)
    below = inside & (patches.points[:, 2] < top - 0.5 * THINNEST) & (patches.points[:, 2] > top - THICKEST)
    down = below & (patches.normals[:, 2] < -ACROSS)
    if patches.areas[down].sum() < UNDERSIDE * area:
        return BOARD
    order = np.argsort(patches.points[down, 2])
    middle = np.searchsorted(np.cumsum(patches.areas[down][order]), 0.5 * patches.areas[down].sum())
    return float(np.clip(top - patches.points[down, 2][order][middle], THINNEST, THICKEST))


def posts_below(board: Piece, reading: Reading, name: str = "leg") -> list[Piece]:
    """Return what carries a board: posts, panels and leaning legs that were seen, then their partners by symmetry,
    where there is room."""
    posts = _seen_posts(board, reading, name)
    low, high = board.corners.min(axis=0)[:2], board.corners.max(axis=0)[:2]
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    for mirror in (np.array([-1.0, 1.0]), np.array([1.0, -1.0])):
        for post in list(posts):
            off = (0.5 * (post.corners.min(axis=0) + post.corners.max(axis=0)))[:2] - middle
            if np.abs(off[mirror < 0])[0] < ASIDE * half[mirror < 0][0]:
                continue
            corners = post.corners.copy()
            corners[:, :2] = middle + mirror * (corners[:, :2] - middle)
            partner = Piece(name, corners, False)
            if not any(_overlap(partner, other) for other in posts):
                posts += next(([piece] for piece in (partner, *_thinner(partner)) if reading.has_room(piece)), [])
    return posts


def _thinner(post: Piece) -> Iterator[Piece]:
    """Yield thinner posts in a post that stands or leans: of the least width along one side, then along both; in its
    middle, then at its edges. What was seen of a post is wider than it is, by voxels and by what depth spreads."""
    ends = post.corners.reshape(2, 4, 3)[..., :2]
    widths = np.ptp(ends, axis=1)[:, None]
    for along in ([True, False], [False, True], [True, True]):
        least = np.where(along, np.minimum(widths, LEAST_POST), widths)
        for side in (np.zeros(2), *CORNER):
            corners = post.corners.copy()
            middles = ends.mean(axis=1, keepdims=True) + 0.5 * side * (widths - least)
            corners[:, :2] = (middles + 0.5 * least * CORNER).reshape(8, 2)
            yield Piece(post.name, corners, post.seen)


def corner_legs(board: Piece, reading: Reading, width: float, beside: Sequence[Piece] = ()) -> list[Piece]:
    """Return inferred legs of a width [m], a corner of a board each: as far out as there is room, and none beside what
    stands there already."""
    low, high = board.corners.min(axis=0), board.corners.max(axis=0)
    middle, half = 0.5 * (low + high)[:2], 0.5 * (high - low)[:2]
    if len(board.corners) > 8:  # of what is round, within its outline
        half = np.sqrt(0.5) * half
    steps = [np.arange(0.0, max(INSET * side, 1e-9), width) for side in half]
    insets = sorted(product(*steps), key=lambda inset: (math.hypot(*inset), inset))
    legs: list[Piece] = []
    for corner in CORNER:
        for inset in insets:
            place = middle + corner * (half - 0.5 * width - inset)
            edges = np.array([*(place - 0.5 * width), reading.base]), np.array([*(place + 0.5 * width), low[2]])
            leg = box_piece("leg", *edges, seen=False)
            if any(_overlap(leg, other) for other in beside):
                break
            if reading.has_room(leg):
                legs.append(leg)
                break
    return legs


def _overlap(a: Piece, b: Piece) -> bool:
    low, high = (np.stack([f(piece.corners[:, :2], axis=0) for piece in (a, b)]) for f in (np.min, np.max))
    return bool(np.all(low.max(axis=0) - LEAST_POST < high.min(axis=0)))


def _seen_posts(board: Piece, reading: Reading, name: str) -> list[Piece]:
    under, patches = float(board.corners[:, 2].min()), reading.patches
    low, high = board.corners.min(axis=0)[:2] - CELL, board.corners.max(axis=0)[:2] + CELL
    slices = int((under - APRON - reading.base) / BIN)
    if slices < 3:
        return []
    inside = np.all((patches.points[:, :2] > low) & (patches.points[:, :2] < high), axis=1)
    inside &= (patches.points[:, 2] > reading.base) & (patches.points[:, 2] < under - APRON)
    inside &= np.abs(patches.normals[:, 2]) < ACROSS
    points = patches.points[inside]
    if len(points) == 0:
        return []
    cells = np.floor((points[:, :2] - low) / CELL).astype(int)
    slice_of = np.clip(((points[:, 2] - reading.base) / BIN).astype(int), 0, slices - 1)
    there = np.zeros((*np.ceil((high - low) / CELL).astype(int) + 1, slices), dtype=bool)
    there[cells[:, 0], cells[:, 1], slice_of] = True
    upright = there.mean(axis=2) >= UPRIGHT
    around = binary_dilation(there, EVERYWHERE[:, :, None]).mean(axis=2) >= UPRIGHT
    leaning = there.any(axis=2) & around & ~binary_dilation(upright, EVERYWHERE, iterations=2)
    posts = []
    for cores in (upright, leaning):
        numbers, count = label(cores, EVERYWHERE)
        for number in range(1, count + 1):
            own = binary_dilation(numbers == number, EVERYWHERE)[cells[:, 0], cells[:, 1]]
            options = (_post(name, points[own], slice_of[own], reading.base, under, share) for share in WIDTHS)
            posts += next(([post] for post in options if post is not None and reading.has_room(post)), [])
    return posts


def _post(name: str, points: np.ndarray, slice_of: np.ndarray, base: float, under: float, share: float) -> Piece | None:
    """Return the post that surface between two heights shows, slice by slice, as wide as this share of the slices are
    at most: rails meet it in some."""
    lows, highs, heights = [], [], []
    for number in np.unique(slice_of):
        rows = slice_of == number
        lows.append(np.percentile(points[rows, :2], 5, axis=0))
        highs.append(np.percentile(points[rows, :2], 95, axis=0))
        heights.append(points[rows, 2].mean())
    low, high, height = np.array(lows), np.array(highs), np.array(heights)
    width = np.maximum(np.quantile(high - low, share, axis=0), LEAST_POST)
    plain = np.all(high - low <= np.maximum(WIDER * width, width + LEAST_POST), axis=1)
    if np.count_nonzero(plain) < 2:
        return None
    middle = 0.5 * (low + high)[plain]
    ends = np.tile(np.median(middle, axis=0), (2, 1))
    if np.count_nonzero(plain) >= 4:
        slope, offset = np.polyfit(height[plain], middle, 1)
        leaning = np.stack([slope * z + offset for z in (base, under)])
        if np.linalg.norm(leaning[1] - leaning[0]) > LEAN:
            ends = leaning
    low_end, high_end = (end + 0.5 * width * CORNER for end in ends)
    corners = [np.column_stack([low_end, np.full(4, base)]), np.column_stack([high_end, np.full(4, under)])]
    return Piece(name, np.concatenate(corners))


def further_pieces(pieces: list[Piece], reading: Reading, distance: np.ndarray) -> list[Piece]:
    """Return boxes around what pieces leave over: rails, aprons, arms, drawers below a top; the largest first.

    `distance` (N,): of the patches from the pieces [m].
    """
    left = reading.patches.chosen((distance > LEFT_OVER) & (reading.patches.points[:, 2] > reading.base))
    if len(left.areas) == 0:
        return []
    corners = np.concatenate([piece.corners for piece in pieces])
    low, high = corners.min(axis=0), corners.max(axis=0)
    cells = np.floor((left.points - left.points.min(axis=0)) / CELL).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    number = label(grid, np.ones((3, 3, 3), dtype=bool))[0][tuple(cells.T)]
    found = []
    for one in np.unique(number):
        part = left.chosen(number == one)
        area = float(part.areas.sum())
        if area < LEAST_LEFT:
            continue
        ends = np.array([bounds(part.points[:, axis], part.areas) for axis in range(3)])
        piece = box_piece("further piece", ends[:, 0], ends[:, 1])
        out = np.concatenate([low - ends[:, 0], ends[:, 1] - high]).max()
        found += [(area, piece)] if out < STICKS_OUT and reading.has_room(piece) else []
    found.sort(key=lambda entry: -entry[0])
    return [piece for _, piece in found[:MOST_LEFT]]

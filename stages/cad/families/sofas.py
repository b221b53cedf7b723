"""Sofas, corner sofas and beds: blocks of the heights of seat, arms and back, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cad.carcasses import ACROSS, grid_of
from scenewright.stages.cad.families.forms import Form, Piece, Reading, box_piece
from scenewright.stages.cad.families.reading import along_x, bounds, in_own_frame, levels
from scenewright.stages.kit.geometry.box_cover import merge_cells
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scipy.ndimage import distance_transform_edt

SEAT_LOW, SEAT_HIGH, LEAST_SEAT = 0.2, 0.65, 0.3
"""Between which heights a seat or a mattress is [m], and its least area [m²]."""
HIGHER, LEAST_HIGHER = 0.12, 0.02
"""Back, arms and headboards end so much higher [m], on this share of the ground at least."""
SAG = 0.05
"""Tops this near in height are of one block [m]; by eye."""
HIGHEST = 1.4
"""A sofa or bed ends below this [m]."""
LYING, MOST_HIGHER = 1.0, 0.15
"""What is so wide both ways [m], without a corner left out, and has at most this share that is higher, is lain on."""
LEAST_BOARD, THICKEST = 0.05, 0.15
"""Surface of a headboard that rises over all else [m²], and its thickness at most [m]; by eye. At a short end, it is a
bed's."""
SEEN = 0.2
"""The top of a cell of the ground is seen where surface that looks up covers this share of it."""
UNSEEN = 0.2
"""Share of the ground that nobody looked down on, at most."""


def read(reading: Reading) -> Form | str:
    """Return the sofa or bed that a surface shows, or why there is none."""
    own = _back_behind(along_x(in_own_frame(reading)))
    patches = own.patches
    places = levels(patches)
    seats = [(z, area) for z, area in places if SEAT_LOW < z - own.base < SEAT_HIGH]
    if not seats or seats[0][1] < LEAST_SEAT:
        return "it has no seat"
    ends = np.array([bounds(patches.points[:, axis], patches.areas) for axis in range(3)])
    low, high = ends[:, 0], ends[:, 1]
    if high[2] - own.base > HIGHEST:
        return "it is higher than a sofa"
    cuts = grid_of(patches, low, high).cuts
    heights = _heights([z for z, _ in places if z > own.base + SEAT_LOW])
    tops, seen = _tops(own, (cuts[0], cuts[1]), heights)
    if not seen.any():
        return "nobody looked down on it"
    ground = np.multiply.outer(np.diff(cuts[0]), np.diff(cuts[1]))
    if ground[~seen & (tops >= 0)].sum() > UNSEEN * ground.sum():
        return "a large part of it was not looked down on"
    higher = float(ground[(tops >= 0) & (heights[tops] > seats[0][0] + HIGHER)].sum() / ground.sum())
    board = _headboard(own, seats[0][0] + HIGHER) if higher < LEAST_HIGHER else None
    if higher < LEAST_HIGHER and board is None:
        return "nothing of it is higher than its seat"
    pieces = [] if board is None else [board]
    for number in np.unique(tops[tops >= 0]):
        for first, last in merge_cells(np.argwhere((tops == number)[:, :, None])):
            a = np.array([cuts[0][first[0]], cuts[1][first[1]], own.base])
            b = np.array([cuts[0][last[0] + 1], cuts[1][last[1] + 1], heights[number]])
            is_seen = bool(seen[first[0] : last[0] + 1, first[1] : last[1] + 1].any())
            is_seat = abs(heights[number] - seats[0][0]) < HIGHER
            piece = box_piece("seat" if is_seat else "block", a, b, seen=is_seen, carries=True)
            pieces += [piece] if is_seen or own.has_room(piece) else []
    wide = min((high - low)[:2]) > LYING and higher < MOST_HIGHER and bool(np.all(tops >= 0))
    lain_on = wide or (board is not None and np.ptp(board.corners[:, 0]) < np.ptp(board.corners[:, 1]))
    return Form("sofa", ("bed", "sofa") if lain_on else ("sofa", "bed"), tuple(pieces), own.turn)


def _headboard(reading: Reading, height: float) -> Piece | None:
    """Return the board that stands higher than a height [m], too thin to be looked down on; None without one."""
    high = reading.patches.chosen(reading.patches.points[:, 2] > height)
    if len(high.areas) == 0 or high.areas.sum() < LEAST_BOARD:
        return None
    ends = np.array([bounds(high.points[:, axis], high.areas) for axis in range(3)])
    if min(np.ptp(ends[:2], axis=1)) > THICKEST:
        return None
    board = box_piece("headboard", np.array([*ends[:2, 0], reading.base]), ends[:, 1])
    return board if reading.has_room(board) else None


def _heights(places: Sequence[float]) -> np.ndarray:
    """Return the heights of blocks [m], ascending, of level places, the largest first: cushions sag."""
    heights: list[float] = []
    for z in places:
        heights += [z] if all(abs(z - other) > SAG for other in heights) else []
    return np.array(sorted(heights))


def _back_behind(reading: Reading) -> Reading:
    """Return the reading turned so that what is high, the back, is at +y of the middle."""
    patches = reading.patches
    high = patches.points[:, 2] > reading.base + SEAT_HIGH
    if not high.any():
        return reading
    middle = 0.5 * sum(bounds(patches.points[:, 1], patches.areas))
    behind = float(np.average(patches.points[high, 1], weights=patches.areas[high])) >= middle
    half = transform_from_yaw(np.pi, np.zeros(3))[:3, :3]
    return reading if behind else reading.turned(reading.turn @ half)


def _tops(reading: Reading, cuts: tuple[np.ndarray, np.ndarray], heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of the height (X, Y) that cells of the ground end at, -1 where they are empty, and whether
    that was seen: what nobody looked down on ends as what is next to it, or is empty."""
    patches = reading.patches
    shape = (len(cuts[0]) - 1, len(cuts[1]) - 1)
    up = patches.chosen(patches.normals[:, 2] > ACROSS)
    index = [np.searchsorted(cut, up.points[:, axis], side="right") - 1 for axis, cut in enumerate(cuts)]
    inside = np.all([(i >= 0) & (i < n) for i, n in zip(index, shape, strict=True)], axis=0)
    inside &= up.points[:, 2] > reading.base + SEAT_LOW
    number = np.abs(up.points[:, 2, None] - heights[None]).argmin(axis=1)
    areas = np.zeros((*shape, len(heights)))
    np.add.at(areas, (index[0][inside], index[1][inside], number[inside]), up.areas[inside])
    ground = np.multiply.outer(np.diff(cuts[0]), np.diff(cuts[1]))
    seen = areas.sum(axis=2) >= SEEN * ground
    tops = areas.argmax(axis=2)
    nearest = distance_transform_edt(~seen, return_distances=False, return_indices=True) if seen.any() else None
    for x, y in np.argwhere(~seen):
        middle = np.array([0.5 * (cuts[0][x] + cuts[0][x + 1]), 0.5 * (cuts[1][y] + cuts[1][y + 1])])
        if nearest is None:
            tops[x, y] = -1
            continue
        tops[x, y] = tops[tuple(nearest[:, x, y])]
        half = 0.25 * np.array([cuts[0][x + 1] - cuts[0][x], cuts[1][y + 1] - cuts[1][y]])
        column = np.array([*(middle - half), reading.base + 0.05]), np.array([*(middle + half), heights[tops[x, y]]])
        if reading.filled(box_piece("column", *column).corners) > 0:
            tops[x, y] = -1
    return tops, seen

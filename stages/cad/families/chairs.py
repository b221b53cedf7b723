"""Chairs: a seat, a back behind it, what carries the seat, arms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cad.carcasses import Patches
from scenewright.stages.cad.families.feet import column_below, least_foot, star_below
from scenewright.stages.cad.families.forms import Form, Piece, Reading
from scenewright.stages.cad.families.reading import (
    ASIDE,
    board_at,
    bounds,
    corner_legs,
    in_own_frame,
    levels,
    posts_below,
)
from scenewright.stages.kit.geometry.steadiness import stands_steadily
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

SEAT_LOW, SEAT_HIGH, LEAST_SEAT = 0.3, 0.65, 0.06
"""Between which heights a seat is [m], and its least area [m²]."""
WIDEST = 0.9
"""A wider one seats two: a bench or a sofa [m]."""
ABOVE_ARMS, HIGHEST = 0.25, 1.3
"""What is higher over the seat is the back, and a chair ends below this [m]."""
LEAST_BACK = 0.03
"""Least surface of a back [m²]."""
REACHES = (0.12, 0.09, 0.07, 0.05)
"""Surface so near to the middle of the back belongs to it [m], while its lean is found; the last of what is found."""
ROW, SOLID_ROW = 0.02, 0.5
"""A back that one sees through is looked at in rows of this height [m]; a row is a rail where so much of its width is
there."""
POST = 0.06
"""The posts of a back with gaps are within so much of its ends [m]."""
THIN, SLAB = 0.02, 10
"""Least thickness of a back [m]; of its surface this percentage may lie before it, and behind."""
SAME_END = 0.05
"""A seat and its back end at the same place where these are so near [m]."""
LEG = 0.04
"""Width of legs that nobody saw [m]; by eye."""


def read(reading: Reading) -> Form | str:
    """Return the chair that a surface shows, or why there is none."""
    own = in_own_frame(reading)
    places = [(z, area) for z, area in levels(own.patches) if SEAT_LOW < z - own.base < SEAT_HIGH]
    if not places or places[0][1] < LEAST_SEAT:
        return "it has no seat"
    height = places[0][0]
    own = _back_behind(own, height)
    seat = board_at("seat", height, own.patches)
    if seat is None or np.ptp(seat.corners[:, :2], axis=0).max() > WIDEST:
        return "its seat has no outline" if seat is None else "its seat is wider than a chair's"
    if own.patches.points[:, 2].max() > own.base + HIGHEST:
        return "it is higher than a chair"
    if not own.seen_through(seat):
        return "nobody saw through below its seat"
    back = _back(own, height, seat)
    if not back:
        return "it has no back"
    legs = posts_below(seat, own)
    feet = star_below(seat, legs, own)
    legs += [] if feet else corner_legs(seat, own, LEG, legs)
    legs = legs or column_below(seat, own)
    if not legs:
        return "nothing carries its seat"
    if not _in_pairs(legs, seat) and not _as_wide(seat, back):
        return "a leg has no partner, and its seat is not as wide as its back, so that part of it is hidden"
    if not feet and not stands_steadily([piece.corners for piece in (seat, *back, *legs)], own.base):
        feet = least_foot(seat, [*back, *legs], own)
    return Form("chair", ("chair",), (seat, *back, *legs, *feet), own.turn)


def _in_pairs(legs: Sequence[Piece], seat: Piece) -> bool:
    """Whether legs stand on both sides of the middle of a seat, or in it: a chair is the same from left and right."""
    middle = 0.5 * (seat.corners[:, 0].min() + seat.corners[:, 0].max())
    half = seat.corners[:, 0].max() - middle
    off = np.array([0.5 * (leg.corners[:, 0].min() + leg.corners[:, 0].max()) - middle for leg in legs])
    return np.count_nonzero(off > ASIDE * half) == np.count_nonzero(off < -ASIDE * half)


def _as_wide(seat: Piece, back: Sequence[Piece]) -> bool:
    """Whether a seat ends at either side where its back does."""
    ends = [
        np.array([f(corners[:, 0]) for f in (np.min, np.max)]) for corners in (seat.corners, *(p.corners for p in back))
    ]
    whole = np.array([min(low for low, _ in ends[1:]), max(high for _, high in ends[1:])])
    return bool(np.all(np.abs(whole - ends[0]) < SAME_END))


def _back_behind(reading: Reading, seat: float) -> Reading:
    """Return the reading turned so that what is high above the seat lies at +y of its middle."""
    patches = reading.patches
    high = patches.points[:, 2] > seat + ABOVE_ARMS
    level = np.abs(patches.points[:, 2] - seat) < 0.02
    if not high.any() or not level.any():
        return reading
    middle = np.average(patches.points[high, :2], axis=0, weights=patches.areas[high])
    off = middle - patches.points[level, :2].mean(axis=0)
    axis = int(np.argmax(np.abs(off)))
    quarter = {(1, True): 0, (0, True): -1, (1, False): 2, (0, False): 1}[axis, bool(off[axis] > 0)]
    turn = transform_from_yaw(0.5 * np.pi * quarter, np.zeros(3))[:3, :3]
    return reading.turned(reading.turn @ turn)


def _back(reading: Reading, seat: float, board: Piece) -> list[Piece]:
    """Return the back: one slab that may lean, or rails between posts where one sees through it."""
    patches = reading.patches
    behind = patches.points[:, 1] > 0.5 * (board.corners[:, 1].min() + board.corners[:, 1].max())
    high = (patches.points[:, 2] > seat + ABOVE_ARMS) & behind
    if not high.any() or patches.areas[high].sum() < LEAST_BACK:
        return []
    slope, offset = 0.0, float(np.average(patches.points[high, 1], weights=patches.areas[high]))
    above = behind & (patches.points[:, 2] > seat + ROW)
    for reach in REACHES:
        lean = patches.points[:, 1] - (slope * patches.points[:, 2] + offset)
        rows = above & (np.abs(lean) < reach)
        z, y = patches.points[rows, 2], patches.points[rows, 1]
        if np.ptp(z) > 0.5 * ABOVE_ARMS:
            slope, offset = np.polyfit(z, y, 1, w=np.sqrt(patches.areas[rows]))
    lean = patches.points[:, 1] - (slope * patches.points[:, 2] + offset)
    rows = above & (np.abs(lean) < REACHES[-1])
    here, lean = patches.chosen(rows), lean[rows]
    if len(lean) < 4:
        return []
    x, z = (bounds(here.points[:, axis], here.areas) for axis in (0, 2))

    def slab(name: str, across: tuple[float, float], low: float, high: float) -> Piece:
        """As thick as the surface is apart that lies there."""
        places, ends = here.points[:, [0, 2]], np.array([across, (low, high)])
        inside = np.all((places > ends[:, 0]) & (places < ends[:, 1]), axis=1)
        first, last = np.percentile(lean[inside] if inside.any() else lean, (SLAB, 100 - SLAB))
        middle, half = 0.5 * (first + last), 0.5 * max(last - first, THIN)
        corners = [
            [side, slope * level + offset + middle + behind, level]
            for side in across
            for behind in (-half, half)
            for level in (low, high)
        ]
        return Piece(name, np.array(corners))

    whole, runs = slab("back", x, seat - ROW, z[1]), _solid_rows(here, x, z)
    if reading.has_room(whole):
        return [whole]
    posts = [slab("post", ends, seat - ROW, z[1]) for ends in ((x[0], x[0] + POST), (x[1] - POST, x[1]))]
    rails = [slab("rail", (x[0] + POST, x[1] - POST), low, high) for low, high in runs]
    pieces = [piece for piece in (*posts, *rails) if reading.has_room(piece)]
    return pieces if rails or len(pieces) == 2 else []


def _solid_rows(patches: Patches, x: tuple[float, float], z: tuple[float, float]) -> list[tuple[float, float]]:
    """Return between which heights a back is solid across [m]."""
    count, columns = max(1, round((z[1] - z[0]) / ROW)), max(1, round((x[1] - x[0]) / ROW))
    row = np.clip(((patches.points[:, 2] - z[0]) / (z[1] - z[0]) * count).astype(int), 0, count - 1)
    column = np.clip(((patches.points[:, 0] - x[0]) / (x[1] - x[0]) * columns).astype(int), 0, columns - 1)
    there = np.zeros((count, columns), dtype=bool)
    there[row, column] = True
    solid = np.r_[False, there.mean(axis=1) >= SOLID_ROW, False]
    starts, ends = np.flatnonzero(~solid[:-1] & solid[1:]), np.flatnonzero(solid[:-1] & ~solid[1:])
    step = (z[1] - z[0]) / count
    return [(z[0] + step * first, z[0] + step * last) for first, last in zip(starts, ends, strict=True)]

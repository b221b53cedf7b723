"""Tables, desks, benches and stools: a top, what carries it, and shelves below it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.cad.families.feet import column_below, foot_below
from scenewright.stages.cad.families.forms import Form, Piece, Reading
from scenewright.stages.cad.families.reading import along_x, board_at, corner_legs, in_own_frame, levels, posts_below
from scenewright.stages.kit.geometry.steadiness import stands_steadily

LEAST_TOP, LOWEST = 0.04, 0.2
"""A top has so much area [m²], at least so high over the ground [m]."""
ABOVE, MOST_ABOVE = 0.06, 0.1
"""From so far above a top on [m], there is at most this share of the surface."""
SHELF = 0.4
"""A shelf below a top has this share of its area."""
STOOL, BENCH, SEAT = 0.55, 0.45, 0.6
"""A stool is no wider, a bench no deeper, and what people sit on is no higher [m]."""
LEG = 0.05
"""Width of legs that nobody saw [m]: those of tables have 4 to 8 cm; by eye."""


def read(reading: Reading) -> Form | str:
    """Return the table that a surface shows, or why there is none."""
    own = along_x(in_own_frame(reading))
    patches = own.patches
    places = levels(patches)
    height, area = next(((z, area) for z, area in places if z > own.base + LOWEST), (0.0, 0.0))
    if area < LEAST_TOP:
        return "it has no top"
    above = patches.areas[patches.points[:, 2] > height + ABOVE].sum()
    if above > MOST_ABOVE * patches.areas.sum():
        return f"{above / patches.areas.sum():.0%} of its surface is above its largest level place"
    top = board_at("top", height, patches)
    if top is None:
        return "its top has no outline"
    legs = posts_below(top, own)
    if not _stands(top, legs, own):
        legs += corner_legs(top, own, LEG, legs)
    if not any(leg.seen for leg in legs) and not _stands(top, legs, own):
        legs = column_below(top, own)
    if not legs:
        return "nothing carries its top"
    if not own.seen_through(top):
        return "nobody saw through below its top"
    if not _stands(top, legs, own):
        legs = [*legs, *foot_below(top, legs, own)]
    shelves = [board_at("shelf", z, patches) for z, share in places if share > SHELF * area and z < height - ABOVE]
    pieces: list[Piece] = [top, *legs, *(shelf for shelf in shelves if shelf is not None)]
    size = np.ptp(top.corners, axis=0)[:2]
    return Form("table", _classes(float(size.max()), float(size.min()), height - own.base), tuple(pieces), own.turn)


def _stands(top: Piece, legs: Sequence[Piece], reading: Reading) -> bool:
    return stands_steadily([top.corners, *(leg.corners for leg in legs)], reading.base)


def _classes(length: float, depth: float, height: float) -> tuple[str, ...]:
    """Return what a table of a size may be called, the likeliest first."""
    if length <= STOOL and height <= 0.85:
        return ("stool", "table")
    if height <= SEAT and depth <= BENCH:
        return ("bench", "table", "stool")
    return ("table", "desk")

"""A seam in the map: a line that is darker or deeper than both its sides, where a leaf ends within the front."""

from __future__ import annotations

import numpy as np
from scenewright.stages.cad.leaves import Leaf, Seen

INNER = 0.04
"""A leaf's edge that lies so far within the front's outline is no silhouette [m]."""
BAND, SIDES = 0.012, (0.025, 0.06)
"""Half width of the line, and where its sides begin and end [m]."""
PIECE = 0.08
"""Edges are looked at in pieces of this length [m]."""
FEWEST = 3
"""Vertices of the line, and of each side, that a piece needs."""
DARKER, DEEPER = 10.0, 0.004
"""A seam is darker than both sides by as much (sRGB, 0 to 255), or deeper [m]."""
SEEN, ALONG = 0.5, 0.7
"""Least share of an edge's pieces that was seen, and of those the least share that shows the seam."""


def seam_contrast(leaf: Leaf, seen: Seen) -> float | None:
    """Return the share of an inner edge along which a seam is seen, of the edge with the clearest; None where no edge
    has one along most of it."""
    shares = [share for axis in (0, 1) for end in (0, 1) if (share := _share(leaf, seen, axis, end)) is not None]
    best = max(shares, default=0.0)
    return round(best, 4) if best >= ALONG else None


def _share(leaf: Leaf, leaf_view: Seen, axis: int, end: int) -> float | None:
    """Return which share of the pieces of one edge show a seam: the edge across `axis` at its least (0) or greatest
    end.

    None for a silhouette, and where too little of the edge was seen.
    """
    edge = end * leaf.size[axis]
    inside = leaf.low[axis] + edge - leaf.body_low[axis]
    if min(inside, leaf.body_size[axis] - inside) < INNER:
        return None
    across, along = leaf_view.places[:, axis] - edge, leaf_view.places[:, 1 - axis]
    pieces = max(1, int(leaf.size[1 - axis] / PIECE))
    number = np.floor(along / leaf.size[1 - axis] * pieces).astype(int)
    light = leaf_view.colors.mean(axis=1)
    line = np.abs(across) < BAND
    sides = [(sign * across > SIDES[0]) & (sign * across < SIDES[1]) for sign in (-1, 1)]
    has_seam = []
    for piece in range(pieces):
        of_piece = number == piece
        line_and_sides = [of_piece & line, *(of_piece & side for side in sides)]
        if min(np.count_nonzero(part) for part in line_and_sides) < FEWEST:
            continue
        middle, *others = (float(np.median(light[part])) for part in line_and_sides)
        depth, *beside = (float(np.median(leaf_view.heights[part])) for part in line_and_sides)
        has_seam.append(middle < min(others) - DARKER or depth < min(beside) - DEEPER)
    return float(np.mean(has_seam)) if len(has_seam) >= SEEN * pieces and len(has_seam) >= 2 else None

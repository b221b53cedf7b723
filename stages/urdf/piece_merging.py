"""Fewer convex pieces: neighbours become one hull where that fills least, and never what another thing takes.

What keeps its mesh is covered with boxes, hundreds of them where it is ragged, and each pair of shapes that touch costs
a simulator its contacts. As in the last step of convex decompositions (Wei et al. 2022, CoACD, section 4.4) the pair
whose hull adds least volume goes first.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.geometry.convex_pieces import hull_volume
from scenewright.stages.urdf.giving_way import CLEARANCE, Piece, with_pieces, written_pieces
from scipy.spatial import ConvexHull, QhullError

MOST_PIECES = 32
"""Most convex pieces of a body, where nothing is in the way of fewer."""
REACH = 0.01
"""Pieces that are farther apart along an axis are no neighbours [m]."""
AROUND = CLEARANCE * np.concatenate([np.eye(3), -np.eye(3)])
"""(6, 3): how far what is merged stays away from other things, along the axes [m]."""
ROUNDING = 1e-4
"""Depths that differ less are the same [m]."""


def merged_bodies(root: Path, bodies: Sequence[BundleBody], most: int = MOST_PIECES) -> list[BundleBody]:
    """Return the bodies of the scene written to `root`, those that keep their mesh with at most `most` pieces, as far
    as what is merged lies in no other body. Raises BadInput."""
    pieces = written_pieces(root)
    result = []
    for body in bodies:
        own = pieces[body.name]
        if body.mesh is None or body.model is not None or len(own) <= most:
            result.append(body)
            continue
        others = [piece for name, some in pieces.items() if name != body.name for piece in some]
        pieces[body.name] = merged(own, others, most)
        shapes = len(own) - sum(len(parts) for parts in body.cut.values()) + len(body.cut)
        result.append(with_pieces(body, {0: pieces[body.name], **{number: [] for number in range(1, shapes)}}))
    return result


def merged(pieces: Sequence[Piece], others: Sequence[Piece], most: int) -> list[Piece]:
    """Return at most `most` convex pieces whose hulls hold those given, more where fewer would come nearer to one of
    `others` than 3 mm, or deeper into it than what they hold."""
    left = {number: _corners(piece) for number, piece in enumerate(pieces)}
    volume = {number: hull_volume(piece.points) for number, piece in left.items()}
    depth: dict[int, float] = {}
    low, high = (np.array([getattr(piece, side) for piece in others]).reshape(-1, 3) for side in ("low", "high"))

    def depth_of(piece: Piece) -> float:
        grown = Piece((piece.points[:, None] + AROUND).reshape(-1, 3))
        near = np.flatnonzero(((low < grown.high) & (high > grown.low)).all(axis=1))
        return max((grown.depth(others[int(k)]) for k in near), default=0.0)

    def offer(first: int, second: int) -> tuple[float, int, int]:
        both = hull_volume(np.concatenate([left[first].points, left[second].points]))
        return both - volume[first] - volume[second], first, second

    beside = _neighbours(list(left.values()))
    heap = [offer(other, number) for number in left for other in sorted(beside[number]) if other < number]
    heapq.heapify(heap)
    following = len(left)
    while len(left) > most and heap:
        _, first, second = heapq.heappop(heap)
        if first not in left or second not in left:
            continue
        one = _corners(Piece(np.concatenate([left[first].points, left[second].points])))
        reached = depth_of(one)
        if reached > ROUNDING:
            for number in (first, second):
                depth.setdefault(number, depth_of(left[number]))
            if reached > max(depth[first], depth[second]) + ROUNDING:
                continue
        del left[first], left[second]
        left[following], volume[following], depth[following] = one, hull_volume(one.points), reached
        beside[following] = {number for number in beside[first] | beside[second] if number in left}
        for number in sorted(beside[following]):
            beside[number].add(following)
            heapq.heappush(heap, offer(number, following))
        following += 1
    return list(left.values())


def _neighbours(pieces: Sequence[Piece]) -> dict[int, set[int]]:
    """Return number of a piece -> the numbers of those at most 1 cm away along each axis."""
    low, high = (np.array([getattr(piece, side) for piece in pieces]) for side in ("low", "high"))
    return {
        number: set(
            np.flatnonzero(((low <= high[number] + REACH) & (high >= low[number] - REACH)).all(axis=1)).tolist()
        )
        - {number}
        for number in range(len(pieces))
    }


def _corners(piece: Piece) -> Piece:
    try:
        return Piece(piece.points[np.sort(ConvexHull(piece.points).vertices)])
    except (QhullError, ValueError):  # flat
        return piece

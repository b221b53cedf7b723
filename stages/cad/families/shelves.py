"""Shelves: boards one above the other, sides that hold them, a back behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.stages.cad.carcasses import ACROSS, Patches, flat_places
from scenewright.stages.cad.families.forms import Form, Piece, Reading, box_piece
from scenewright.stages.cad.families.reading import APART, along_x, bounds, in_own_frame, levels, posts_below
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

FEWEST, ALIKE = 2, 0.4
"""A shelf has so many boards, of this share of the largest one's area: things hide what they stand on."""
TELLING = 3
"""From so many boards on, all seen from above or below, one has seen into it: a closed thing shows its top alone."""
NARROWEST, LOWEST = 0.2, 0.6
"""A shelf that stands is at least so wide and so high [m]."""
AT_THE_REAR, BACK, LEAST_BACK = 0.06, 0.015, 0.3
"""Surface so near to the rear, looking to the front, is a back of this thickness [m], where it covers this share."""
THICK = 0.025
"""Thickness of boards [m]: those of shelves have 2 to 3 cm."""
AT_THE_END, DIVIDES = 0.1, 0.5
"""Uprights are so near to an end [m], or go through so much of the depth; by eye."""
SIDE = 0.02
"""Thickness of a side that nobody saw [m]."""


def read(reading: Reading) -> Form | str:
    """Return the shelf that a surface shows, or why there is none."""
    own = _from_the_front(along_x(in_own_frame(reading)))
    patches = own.patches
    heights = _heights(own)
    if len(heights) < FEWEST:
        return f"it has {len(heights)} boards of one size"
    ends = np.array([bounds(patches.points[:, axis], patches.areas) for axis in range(3)])
    if ends[0, 1] - ends[0, 0] < NARROWEST or ends[2, 1] - own.base < LOWEST:
        return "it is smaller than a shelf"
    low, high = ends[:, 0], ends[:, 1]
    low[2] = own.base
    if len(heights) < TELLING and not own.seen_into(low, high):
        return "nobody saw into it"
    boards = []
    for z in heights:
        board = box_piece("board", np.array([*low[:2], z - THICK]), np.array([*high[:2], z]), carries=True)
        boards += [board] if z in own.carrying or own.has_room(board) else []
    if len(boards) < FEWEST:
        return "cameras saw that there is nothing where its boards would be"
    rear = _rear(patches, high)
    uprights = posts_below(_lid(low, high), replace(own, patches=patches.chosen(~rear)), "side")
    sides = [side for side in uprights if _holds(side, low, high)]
    if not sides:
        left, right = high.copy(), low.copy()
        left[0], right[0] = low[0] + SIDE, high[0] - SIDE
        sides = [box_piece("side", *ends, seen=False) for ends in ((low, left), (right, high))]
        sides = [side for side in sides if own.has_room(side)]
    if len(sides) < 2:
        return "nothing holds its boards"
    return Form("shelf", ("shelf",), (*boards, *sides, *_back(own, rear, low, high)), own.turn)


def _from_the_front(reading: Reading) -> Reading:
    """Return the reading turned so that most of its upright surface looks to -y."""
    patches = reading.patches
    front, rear = (patches.areas[sign * patches.normals[:, 1] > ACROSS].sum() for sign in (-1, 1))
    half = transform_from_yaw(np.pi, np.zeros(3))[:3, :3]
    return reading if front >= rear else reading.turned(reading.turn @ half)


def _heights(reading: Reading) -> list[float]:
    """Return the heights of the tops of boards [m], ascending: of level places, of undersides, which are all that is
    seen of boards above one's eyes, and where things stand."""
    patches = reading.patches
    down = patches.normals[:, 2] < -ACROSS
    below = flat_places(patches.points[down, 2], patches.areas[down])
    places = [*levels(patches), *((z + THICK, area) for z, area in below)]
    largest = max((area for _, area in places), default=0.0)
    places = [(z, area) for z, area in places if area >= ALIKE * largest]
    heights: list[float] = []
    for z in (*reading.carrying, *(z for z, _ in sorted(places, key=lambda place: -place[1]))):
        if all(abs(z - other) > APART for other in heights):
            heights.append(z)
    return sorted(heights)


def _lid(low: np.ndarray, high: np.ndarray) -> Piece:
    return box_piece("lid", np.array([*low[:2], high[2]]), np.array([*high[:2], high[2] + BACK]))


def _holds(side: Piece, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether an upright is at an end of the boards or divides them: what stands on them does neither."""
    ends = np.array([side.corners.min(axis=0), side.corners.max(axis=0)])
    at_end = ends[0, 0] < low[0] + AT_THE_END or ends[1, 0] > high[0] - AT_THE_END
    return bool(at_end or np.ptp(ends[:, 1]) > DIVIDES * (high[1] - low[1]))


def _rear(patches: Patches, high: np.ndarray) -> np.ndarray:
    """Return (N,) bool: the patches at the rear that look to the front."""
    return np.asarray((patches.points[:, 1] > high[1] - AT_THE_REAR) & (patches.normals[:, 1] < -ACROSS))


def _back(reading: Reading, rear: np.ndarray, low: np.ndarray, high: np.ndarray) -> list[Piece]:
    patches = reading.patches
    if patches.areas[rear].sum() < LEAST_BACK * (high[0] - low[0]) * (high[2] - low[2]):
        return []
    front = float(np.average(patches.points[rear, 1], weights=patches.areas[rear]))
    first, last = low.copy(), high.copy()
    first[1], last[1] = front, max(high[1], front + BACK)
    back = box_piece("back", first, last)
    return [back] if reading.has_room(back) else []

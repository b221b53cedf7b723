"""Cabinets that stand open: a carcass that one sees into, and a door that stands out of it from one of its edges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scenewright.stages.cad.carcasses import ACROSS, Patches, flat_places, own_yaw
from scenewright.stages.cad.families.cabinet_parts import BOARD, FRONT, GAP, Thickness, boards, closed_leaf
from scenewright.stages.cad.families.forms import Form, Leaf, Piece, Reading, box_piece
from scenewright.stages.cad.families.reading import APART, SAME_LEVEL, board_at, bounds, level_rows, levels
from scenewright.stages.cad.front_bars import front_of
from scenewright.stages.cad.front_leaves import leaves_of
from scenewright.stages.kit.geometry.boxes import minimum_rectangle
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

LEAST_SHELF = 0.04
"""Surface of a level place inside [m²]."""
ALIKE = 0.7
"""Boards of one carcass have so much of their width in common."""
MOST_PLACES = 3
"""So many level places are asked how they are turned."""
SMALLEST = np.array([0.25, 0.15, 0.3])
"""Least width, depth and height of a carcass [m]."""
RIM = 0.06
"""The edges of a carcass are so near to where what is inside ends [m]."""
BEHIND, BEFORE = 0.04, 0.1
"""What is so far behind the front of a carcass is of it, and what is so far before it of an open door [m]: shut doors
lie between."""
LEAST_DOOR, OF_ALL = 0.1, 0.1
"""Surface of a door [m²], and its share of all."""
FROM_EDGE, AS_WIDE = 0.2, (0.7, 1.2)
"""A door begins so near to an edge of its carcass [m], and is so many times as wide."""
OPEN = (math.radians(20.0), math.radians(165.0))
"""Between these angles a door stands open."""
THICK, THICKEST = 0.04, 0.08
"""Thickness of a door, by eye, and most of a side [m]."""
LEAST_REST = 0.12
"""What a door leaves of the front, above or below it, is a front of its own from this height on [m]."""
HALF = 0.5
"""Of a side no more may lie in space seen to be empty: else it is an open rack."""
NOTHING = "nothing stands before it"
FRIDGE = ((0.45, 0.95), (1.1, 2.1))
"""Width and height of fridges [m]."""


@dataclass(frozen=True)
class Opened:
    """A carcass and the door before it; the front looks to -y."""

    low: np.ndarray
    """(3,) least corner of the carcass [m]."""
    high: np.ndarray
    """(3,)."""
    walls: Thickness
    shelves: tuple[float, ...]
    """Heights of level places in it, and at which things stand in it [m]."""
    door: tuple[float, float]
    """Between which heights its door is [m]."""
    hinge_right: bool
    angle: float
    """At which it stands [rad]."""
    thick: tuple[float, float]
    """Where its outer and inner face are when it is shut, from the edges of the carcass, to the rear [m]."""

    @property
    def hinge(self) -> np.ndarray:
        """(3,) on the axis of the door: the edge of the carcass, half way up the door [m]."""
        return np.array([self.high[0] if self.hinge_right else self.low[0], self.low[1], 0.5 * sum(self.door)])


def read(reading: Reading) -> Form | str:
    """Return the open cabinet that a surface shows, or why there is none."""
    reasons: list[str] = []
    forms: list[Form] = []
    for yaw in product(_yaws(reading.patches), 0.5 * np.pi * np.arange(4)):
        turned = reading.turned(reading.turn @ transform_from_yaw(sum(yaw), np.zeros(3))[:3, :3])
        found = opened(turned.patches, turned.base, turned.carrying)
        if isinstance(found, str):
            reasons.append(found)
            continue
        form = _form(found, turned)
        if any(turned.filled(piece.corners) > HALF for piece in form.pieces if piece.name == "side"):
            reasons.append("cameras saw that its sides are not there")
            continue
        forms.append(form)
    if forms:
        return max(forms, key=lambda form: form.explains(reading))
    return next((why for why in reasons if why != NOTHING), NOTHING)


def _yaws(patches: Patches) -> list[float]:
    """Return how a carcass may be turned [rad]: as most upright surface is, and as each level place is. A door is a
    large part of what is upright, and its top may be level with that of its carcass."""
    up = level_rows(patches)
    places = [z for z, area in levels(patches) if area >= LEAST_SHELF][:MOST_PLACES]
    at = [patches.points[up & (np.abs(patches.points[:, 2] - z) < SAME_LEVEL), :2] for z in places]
    return [own_yaw(patches), *(minimum_rectangle(points)[2] for points in at if len(points) >= 4)]


def opened(patches: Patches, base: float, carrying: Sequence[float] = ()) -> Opened | str:
    """Return the carcass that looks to -y and its open door, or why there is none. `base`: height of the floor,
    `carrying`: heights at which things stand in it [m]."""
    places = [z for z, area in levels(patches) if area >= LEAST_SHELF]
    shelves = [board for z in places if (board := board_at("shelf", z, patches)) is not None]
    if not shelves:
        return "it has no level place"
    low, high = shelves[0].corners.min(axis=0), shelves[0].corners.max(axis=0)
    alike = [board.corners.min(axis=0)[1] for board in shelves if _beside(board, low[0], high[0]) > ALIKE]
    low[1] = min(alike)
    front = _front_edge(patches, low, high)
    inside = patches.chosen(patches.points[:, 1] > front + BEHIND)  # a door has its edge beside the front
    if len(inside.areas) == 0:
        return "it is too small"
    ends = np.array([bounds(inside.points[:, axis], inside.areas) for axis in range(3)])
    low = np.array([ends[0, 0], front, base])
    if np.any(ends[:, 1] - low < SMALLEST):
        return "it is too small"
    out = patches.chosen(patches.points[:, 1] < front - BEFORE)
    if out.areas.sum() < max(LEAST_DOOR, OF_ALL * patches.areas.sum()):
        return NOTHING
    swung = _swung(out, low[0], ends[0, 1], front)
    if isinstance(swung, str):
        return swung
    right, angle = swung
    door = bounds(out.points[:, 2], out.areas)
    inner = [z for z in places if base + RIM < z < ends[2, 1] - RIM and _is_inside(z, patches, low, ends[:, 1])]
    for z in carrying:
        if base + RIM < z < ends[2, 1] - RIM and all(abs(z - other) > APART for other in inner):
            inner.append(z)
    leaf = max(door[0], base), min(door[1], float(ends[2, 1]))
    walls = _walls(inside, low, ends[:, 1])
    found = Opened(low, ends[:, 1], walls, tuple(inner), leaf, right, angle, (-THICK, 0.0))
    return _door(found, out)


def _beside(board: Piece, left: float, right: float) -> float:
    """Return which share of a board lies between two places [m] along the front."""
    low, high = board.corners[:, 0].min(), board.corners[:, 0].max()
    return float(max(min(high, right) - max(low, left), 0.0) / max(high - low, right - left))


def _front_edge(patches: Patches, low: np.ndarray, high: np.ndarray) -> float:
    """Return where a carcass ends to the front [m]: at the edges of its boards, if they are seen before what is
    inside."""
    facing = (patches.normals[:, 1] < -ACROSS) & (np.abs(patches.points[:, 1] - low[1]) < RIM)
    facing &= (patches.points[:, 0] > low[0] - RIM) & (patches.points[:, 0] < high[0] + RIM)
    places = flat_places(patches.points[facing, 1], patches.areas[facing])
    return max(places, key=lambda place: place[1])[0] if places else float(low[1])


def _swung(out: Patches, left: float, right: float, front: float) -> tuple[bool, float] | str:
    """Return whether the door that surface before a carcass shows hangs on its right edge, and its angle [rad]."""
    middle = np.average(out.points[:, :2], axis=0, weights=out.areas)
    off = out.points[:, :2] - middle
    along = np.linalg.eigh((off * out.areas[:, None]).T @ off)[1][:, 1]
    first, last = bounds(off @ along, out.areas)
    tips = [middle + first * along, middle + last * along]
    corners = [np.array([left, front]), np.array([right, front])]
    near = [(float(np.linalg.norm(tips[t] - corners[c])), t, c) for t in (0, 1) for c in (0, 1)]
    distance, tip, corner = min(near)
    if distance > FROM_EDGE:
        return "what stands before it begins at no edge of it"
    arm = tips[1 - tip] - corners[corner]
    width = float(np.linalg.norm(arm))
    if not AS_WIDE[0] <= width / (right - left) <= AS_WIDE[1]:
        return f"what stands before it is {width / (right - left):.0%} as wide"
    shut = np.array([-1.0 if corner == 1 else 1.0, 0.0])
    angle = math.atan2(-arm[1], float(arm @ shut))
    return (corner == 1, angle) if OPEN[0] < angle < OPEN[1] else "what stands before it is no open door"


def _walls(inside: Patches, low: np.ndarray, high: np.ndarray) -> Thickness:
    """Return how thick the walls of a carcass are whose insides were seen."""

    def inner(axis: int, sign: float, end: float) -> float:
        facing = sign * inside.normals[:, axis] > ACROSS
        near = facing & (np.abs(inside.points[:, axis] - end) < THICKEST)
        places = flat_places(inside.points[near, axis], inside.areas[near])
        return max(abs(max(places, key=lambda place: place[1])[0] - end), BOARD) if places else BOARD

    return Thickness(inner(0, 1.0, low[0]), inner(0, -1.0, high[0]), inner(1, -1.0, high[1]))


def _door(found: Opened, out: Patches) -> Opened:
    """Return it with the faces of its door where they were seen."""
    back = transform_from_yaw(-found.angle if found.hinge_right else found.angle, np.zeros(3))[:3, :3]
    shut = Patches((out.points - found.hinge) @ back.T, out.normals @ back.T, out.areas)
    faces = []
    for sign, usual in ((-1.0, -GAP - THICK), (1.0, -GAP)):
        facing = (sign * shut.normals[:, 1] > ACROSS) & (np.abs(shut.points[:, 1]) < 2 * THICKEST)
        places = flat_places(shut.points[facing, 1], shut.areas[facing])
        faces.append(max(places, key=lambda place: place[1])[0] if places else usual)
    outer, inner = faces if faces[1] - faces[0] > BOARD else (faces[0], faces[0] + THICK)
    return replace(found, thick=(outer, inner))


def _is_inside(z: float, patches: Patches, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether most of a level place lies in a carcass: doors have shelves too."""
    at = (patches.normals[:, 2] > ACROSS) & (np.abs(patches.points[:, 2] - z) < 0.5 * RIM)
    within = at & np.all((patches.points[:, :2] > low[:2] - 0.01) & (patches.points[:, :2] < high[:2] + 0.01), axis=1)
    return bool(patches.areas[within].sum() >= LEAST_SHELF)


def _form(found: Opened, reading: Reading) -> Form:
    """Return the form of an open cabinet: its carcass with boards, its door, and what shuts the rest of its front."""
    low, high, walls = found.low, found.high, found.walls
    z0 = found.door[0] if found.door[0] - low[2] >= LEAST_REST else low[2]
    z1 = found.door[1] if high[2] - found.door[1] >= LEAST_REST else high[2]

    def board(top: float, recess: float, *, seen: bool) -> Piece:
        ends = (low[0] + walls.left, low[1] + recess, top - BOARD), (high[0] - walls.right, high[1] - walls.back, top)
        return box_piece("board", np.array(ends[0]), np.array(ends[1]), seen=seen, carries=seen)

    pieces = [*boards(low, high, walls), *(board(z, 2 * BOARD, seen=True) for z in found.shelves)]
    leaves = [_open_leaf(found, z0, z1)]
    for bottom, top, divider in ((low[2], z0, z0), (z1, high[2], z1 + BOARD)):
        if top > bottom:
            fixed, more = _rest(reading, low, high, bottom, top, len(leaves))
            pieces += [*fixed, board(divider, 0.0, seen=False)]
            leaves += more
    kept = tuple(piece for piece in pieces if piece.seen or reading.has_room(piece))
    return Form("cabinet", _classes(high - low), kept, reading.turn, tuple(leaves))


def _rest(
    reading: Reading, low: np.ndarray, high: np.ndarray, bottom: float, top: float, before: int
) -> tuple[list[Piece], list[Leaf]]:
    """Return what closes the front between two heights [m]: the leaves that its bars tell, or a plate."""
    z = reading.patches.points[:, 2]
    front = front_of(reading.patches.chosen((z > bottom) & (z < top)))
    leaves = "no front" if front is None else leaves_of(front)
    if front is None or isinstance(leaves, str):
        ends = np.array([low[0], low[1] - FRONT, bottom]), np.array([high[0], low[1], top])
        return [box_piece("front", *ends)], []
    return [], [closed_leaf(before + k, leaf, front.level, float(high[1])) for k, leaf in enumerate(leaves, 1)]


def _open_leaf(found: Opened, z0: float, z1: float) -> Leaf:
    """Return the door, shut, with the angle at which it stands."""
    low = np.array([found.low[0], found.low[1] + found.thick[0], z0])
    high = np.array([found.high[0], found.low[1] + found.thick[1], z1])
    free = low[0] + 0.05 if found.hinge_right else high[0] - 0.05
    return Leaf(
        "door_1",
        "revolute",
        (box_piece("front", low, high),),
        found.hinge,
        np.array([0.0, 0.0, 1.0 if found.hinge_right else -1.0]),
        max(found.angle, 0.5 * math.pi),
        np.array([free, low[1], 0.5 * (z0 + z1)]),
        np.array([0.0, 0.0, 1.0]),
        seen=False,
        value=found.angle,
    )


def _classes(size: np.ndarray) -> tuple[str, ...]:
    """Return what it may be called, the likeliest first."""
    (narrow, wide), (least, most) = FRIDGE
    if narrow < size[0] < wide and least < size[2] < most:
        return ("fridge", "wardrobe", "cabinet")
    return ("wardrobe", "cabinet") if size[2] > most else ("cabinet",)

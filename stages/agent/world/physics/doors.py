"""Furniture with a door as it truly is: hollow, with a leaf on a hinge or a drawer on a slide, and a handle on it.

Its own frame: the middle of its foot, x out of the front, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2

import numpy as np
from scenewright.schemas.apartment import Apartment, Furniture
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.agent.world.physics.shapes import Piece, jointed_text, slab
from scenewright.stages.kit.geometry.transforms import transform_from_yaw

DRAWERS = ("dresser",)
"""Furniture of which the top is a drawer as wide as itself; all other has a leaf as large as its front."""
WALL, PANEL = 0.03, 0.02
"""Thickness of walls, and of leaf or drawer front [m]."""
SHELF = 0.5
"""Height of the shelf on which things stand behind a leaf, as a share of the furniture's."""
DRAWER, TRAY = 0.20, 0.10
"""Height of a drawer's front, and of its other sides [m]."""
BEHIND = 0.04
"""Length of a drawer that stays in the furniture when it is out [m]; by eye."""
WIDEST = 2.0
"""Angle at which a leaf stops [rad]."""
BAR, BEFORE = 0.02, 0.045
"""Thickness of a handle's bar, and its middle before the front [m]."""
BAR_LENGTH, FROM_EDGE = 0.2, 0.06
"""Length of a handle's bar, and its distance from the leaf's edge [m]; by eye."""


@dataclass(frozen=True)
class Doored:
    """Furniture with a door: pieces of what stands still, of what moves and of the handle on it."""

    name: str
    pose: np.ndarray
    """world_from_body (4, 4)."""
    still: tuple[Piece, ...]
    moving: tuple[Piece, ...]
    handle: tuple[Piece, ...]
    joint: Joint
    floor: float
    """Height on which things inside lie [m]."""

    def urdf(self) -> str:
        """Return URDF text of it."""
        return jointed_text(self.name, self.still, (*self.moving, *self.handle), self.joint)


def front_of(apartment: Apartment, piece: Furniture) -> tuple[np.ndarray, float]:
    """Return the unit normal (2,) of a piece's front, away from the nearest wall of its room, and on which side of it
    (1: left as it looks out, -1: right) the next wall is nearer, where a leaf has its hinge."""
    x, y = piece.centre
    inside = [r for r in apartment.rooms if r.low[0] <= x <= r.high[0] and r.low[1] <= y <= r.high[1]]
    room = inside[0] if inside else apartment.rooms[0]
    gaps = {
        (1, 0): x - piece.size[0] / 2 - room.low[0],
        (-1, 0): room.high[0] - x - piece.size[0] / 2,
        (0, 1): y - piece.size[1] / 2 - room.low[1],
        (0, -1): room.high[1] - y - piece.size[1] / 2,
    }
    normal = min(gaps, key=lambda side: gaps[side])
    left_direction = (-normal[1], normal[0])
    # the gap to a wall is filed under the direction away from it
    hinge = 1.0 if gaps[(-left_direction[0], -left_direction[1])] <= gaps[left_direction] else -1.0
    return np.array(normal, float), hinge


def doored(apartment: Apartment, piece: Furniture) -> Doored:
    """Return a piece of furniture with its door."""
    normal, hinge = front_of(apartment, piece)
    depth, width = piece.size if abs(normal[0]) > 0.5 else piece.size[::-1]
    pose = transform_from_yaw(atan2(normal[1], normal[0]), np.array([*piece.centre, 0.0]))
    make = _with_drawer if piece.label in DRAWERS else _with_leaf
    return make(piece.name, pose, depth / 2, width / 2, piece.height, hinge)


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Piece:
    return slab((x[0], y[0], z[0]), (x[1], y[1], z[1]))


def _with_leaf(name: str, pose: np.ndarray, d: float, w: float, height: float, hinge: float) -> Doored:
    """`d`, `w`: half of depth and width [m]."""
    front, floor = d - PANEL, SHELF * height
    x, y = (-d, front), (-w, w)
    still = (
        _box((-d, WALL - d), y, (0, height)),
        _box(x, (-w, WALL - w), (0, height)),
        _box(x, (w - WALL, w), (0, height)),
        _box(x, y, (0, WALL)),
        _box(x, y, (height - WALL, height)),
        _box((-d, front - 0.02), y, (floor - 0.015, floor)),
    )
    at, middle = hinge * (FROM_EDGE - w), 0.7 * height
    ends = (middle - BAR_LENGTH / 2, middle + BAR_LENGTH / 2)
    across = (at - BAR / 2, at + BAR / 2)
    handle = (
        _box((d + BEFORE - BAR / 2, d + BEFORE + BAR / 2), across, ends),
        *(_box((d, d + BEFORE), across, (end - BAR / 2, end + BAR / 2)) for end in ends),
    )
    joint = Joint(
        name=f"{name}__hinge",
        type="revolute",
        part=f"{name}__door",
        origin=(front, hinge * w, 0.0),
        axis=(0.0, 0.0, hinge),
        lower=0.0,
        upper=WIDEST,
    )
    return Doored(name, pose, still, (_box((front, d), y, (0.02, height)),), handle, joint, floor)


def _with_drawer(name: str, pose: np.ndarray, d: float, w: float, height: float, _: float) -> Doored:
    top = height - PANEL
    low = max(WALL, top - DRAWER)
    x, y = (-d, d - PANEL), (-w, w)
    still = (
        _box((-d, PANEL - d), y, (0, height)),
        _box(x, (-w, PANEL - w), (0, height)),
        _box(x, (w - PANEL, w), (0, height)),
        _box(x, y, (top, height)),
        _box(x, y, (0, low - 0.006)),
    )
    inner, across = (2 * PANEL - d, d - PANEL), (2 * PANEL - w, w - 2 * PANEL)
    edge = (low, min(low + TRAY, top - 0.01))
    moving = (
        _box((d - PANEL, d), (0.005 - w, w - 0.005), (low, top - 0.005)),
        _box(inner, across, (low, low + 0.01)),
        _box((inner[0], inner[0] + 0.01), across, edge),
        _box(inner, (across[0], across[0] + 0.01), edge),
        _box(inner, (across[1] - 0.01, across[1]), edge),
    )
    level = (low + top) / 2
    upright, ends = (level - BAR / 2, level + BAR / 2), (-BAR_LENGTH / 2, BAR_LENGTH / 2)
    handle = (
        _box((d + BEFORE - BAR / 2, d + BEFORE + BAR / 2), ends, upright),
        *(_box((d, d + BEFORE), (end - BAR / 2, end + BAR / 2), upright) for end in ends),
    )
    joint = Joint(
        name=f"{name}__slide",
        type="prismatic",
        part=f"{name}__drawer",
        origin=(0.0, 0.0, 0.0),
        axis=(1.0, 0.0, 0.0),
        lower=0.0,
        upper=2 * d - BEHIND,
    )
    return Doored(name, pose, still, moving, handle, joint, low + 0.01)

"""What a family makes of a thing: convex pieces in the frame of the thing, each seen or inferred."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.cad.carcasses import Patches
from scenewright.stages.cad.completion import inside_points
from scenewright.stages.cad.explained import NEAR, distances
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.kit.geometry.solids import Solid, hull_or_box
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

MOST_FILLED = 0.2
"""Share of a piece that was seen that may lie in space seen to be empty, as posts are some voxels wide; of
what is inferred, none but its rim (`UNSURE`)."""
SEEN_THROUGH, ASIDE, APRON = 0.1, 0.05, 0.1
"""Below a top, this share of the room was seen empty, so far from its edges and from top and ground [m]: what nobody
saw through may be a box."""
UNSURE = 0.02
"""Where space that was seen empty ends is known to this [m]: a voxel of a map."""
INFERRED_WORDS = "; inferred: "
"""Between what was seen of a form and what was not, in words."""
FACES = 0.9
"""A wall faces a thing from this cosine on."""
SPACING, COARSE = 0.02, 0.05
"""Distance of the points at which a piece, and the room below a top, is held against seen space [m]: a voxel of a map
for what may be thin."""


@dataclass(frozen=True)
class Piece:
    """A convex piece of a form."""

    name: str
    """Top, board, leg, seat, back, further piece."""
    corners: np.ndarray
    """(N, 3) [m], frame of the thing."""
    seen: bool = True
    """Whether surface of it was seen; else symmetry or the family says that it is there."""
    level: tuple[np.ndarray, np.ndarray] | None = None
    """Low and high corner (3,) of the least rectangle around where things can stand, where it has such a place."""


@dataclass(frozen=True)
class Leaf:
    """A part of a form that moves. Shut; frame of the thing."""

    name: str
    type: Literal["revolute", "prismatic"]
    pieces: tuple[Piece, ...]
    origin: np.ndarray
    """(3,) on its axis [m]."""
    axis: np.ndarray
    """(3,) unit: it opens by a positive value."""
    travel: float
    """How far [rad] or [m]."""
    handle: np.ndarray
    """(3,) where it is grasped [m]."""
    handle_axis: np.ndarray
    """(3,) unit, along its bar."""
    seen: bool = True
    """Whether its bar was."""
    value: float = 0.0
    """As it stands [rad] or [m]."""

    @property
    def standing(self) -> tuple[Piece, ...]:
        """Its pieces as it stands."""
        if self.value == 0.0:
            return self.pieces
        if self.type == "prismatic":
            return tuple(replace(piece, corners=piece.corners + self.value * self.axis) for piece in self.pieces)
        turn = Rotation.from_rotvec(self.value * self.axis).as_matrix()
        return tuple(
            replace(piece, corners=(piece.corners - self.origin) @ turn.T + self.origin) for piece in self.pieces
        )


@dataclass(frozen=True)
class Form:
    """What a family makes of a thing."""

    family: str
    classes: tuple[str, ...]
    """What a thing of this form and size may be, the likeliest first."""
    pieces: tuple[Piece, ...]
    turn: np.ndarray
    """(3, 3): world from the frame of the thing."""
    leaves: tuple[Leaf, ...] = ()

    @cached_property
    def solids(self) -> list[Solid]:
        """Its pieces and those of its leaves, as they stand, as polyhedra, frame of the thing."""
        pieces = [*self.pieces, *(piece for leaf in self.leaves for piece in leaf.standing)]
        return [hull_or_box(piece.corners) for piece in pieces]

    def distance(self, patches: Patches) -> np.ndarray:
        """Return how far patches of surface, frame of the thing, are from it (N,) [m]."""
        return distances(patches.points, [(solid.vertices, solid.faces) for solid in self.solids])

    def explains(self, reading: Reading) -> float:
        """Return how much of a surface lies near it [m²]."""
        patches = reading.turned(self.turn).patches
        return float(patches.areas[self.distance(patches) < reading.within].sum())

    @property
    def words(self) -> str:
        """Its pieces in words."""
        seen = [piece.name for piece in self.pieces if piece.seen] + [leaf.name.split("_")[0] for leaf in self.leaves]
        inferred = [piece.name for piece in self.pieces if not piece.seen]
        listed = ", ".join(_counted(seen))
        return f"{listed}{INFERRED_WORDS}{', '.join(_counted(inferred))}" if inferred else listed

    @property
    def inferred(self) -> list[int]:
        """The numbers of the pieces that nobody saw."""
        return [number for number, piece in enumerate(self.pieces) if not piece.seen]


@dataclass(frozen=True)
class Reading:
    """The surface of a thing, and where nothing may be."""

    patches: Patches
    """Frame of the thing."""
    base: float
    """Height of what it stands on [m]."""
    turn: np.ndarray
    """(3, 3): world from the frame of the thing."""
    free_space: FreeSpace
    own: cKDTree
    """Of the vertices of the thing, world [m]."""
    carrying: tuple[float, ...] = ()
    """Heights at which things stand on it or in it [m]."""
    hangs: bool = False
    """Whether it stands on nothing: on a wall."""
    walls: tuple[SurfacePlane, ...] = ()
    """Upright planes of the room's walls, world frame."""
    class_name: str = ""
    """What masks named it."""
    within: float = NEAR
    """Surface so near is explained [m]."""

    def turned(self, turn: np.ndarray) -> Reading:
        """Return it in another frame: `turn` (3, 3), world from that frame."""
        return replace(self, patches=self.patches.turned(self.turn.T @ turn), turn=turn)

    def wall_behind(self, point: np.ndarray) -> float | None:
        """Return y of the wall that faces -y behind a point (3,), frame of the thing [m]; None without one."""
        found = []
        for wall in self.walls:
            normal, there = np.asarray(wall.normal), self.turn @ point
            if normal @ self.turn[:, 1] < -FACES:
                found.append(point[1] - (normal @ there + wall.offset) / (normal @ self.turn[:, 1]))
        return min((float(y) for y in found if y > point[1]), default=None)

    def filled(self, corners: np.ndarray, spacing: float = SPACING) -> float:
        """Return the share of a convex piece, corners (N, 3), that lies in space that was seen empty, by points at most
        `spacing` [m] apart."""
        points = inside_points(corners, spacing)
        if len(points) == 0:
            return 0.0
        return float(np.mean(self.free_space.is_empty(points @ self.turn.T, self.own)))

    def seen_through(self, board: Piece) -> bool:
        """Whether cameras saw that there is room below a board."""
        low, high = board.corners.min(axis=0), board.corners.max(axis=0)
        return self.seen_into(np.array([*low[:2], self.base]), np.array([*high[:2], low[2]]))

    def seen_into(self, low: np.ndarray, high: np.ndarray) -> bool:
        """Whether cameras saw that there is room between two corners (3,)."""
        first, last = low + (ASIDE, ASIDE, APRON), high - (ASIDE, ASIDE, APRON)
        return (
            bool(np.all(last > first)) and self.filled(box_piece("room", first, last).corners, COARSE) >= SEEN_THROUGH
        )

    def has_room(self, piece: Piece) -> bool:
        """Whether a piece does not lie in space that was seen empty; of one that nobody saw, all that is farther inside
        than where space ends is known."""
        if piece.seen:
            return self.filled(piece.corners) <= MOST_FILLED
        middle, half = piece.corners.mean(axis=0), 0.5 * np.ptp(piece.corners, axis=0)
        inside = np.maximum(half - UNSURE, 1e-4) / np.maximum(half, 1e-4)
        return self.filled(middle + inside * (piece.corners - middle)) == 0.0


def box_piece(name: str, low: np.ndarray, high: np.ndarray, *, seen: bool = True, carries: bool = False) -> Piece:
    """Return the box between two corners (3,) as a piece; with a level surface where it `carries`."""
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    level = (np.array([low[0], low[1], high[2]]), np.asarray(high, dtype=float)) if carries else None
    return Piece(name, corners, seen, level)


def _counted(names: Sequence[str]) -> list[str]:
    return [f"{names.count(name)} {name}s" if names.count(name) > 1 else name for name in dict.fromkeys(names)]

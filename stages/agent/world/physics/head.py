"""What the head camera's turn tells: free and occupied floor, and large furniture as boxes."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scenewright.stages.agent.obstacle_map import CELL
from scenewright.stages.kit.geometry.point_clouds import clusters
from scipy.ndimage import maximum_filter, minimum_filter

TURNS = 6
"""Pictures of one turn."""
HEIGHT, PITCH = 1.35, 0.55
"""Height of the camera over the floor [m], and how far it looks down [rad]."""
FLOOR, CEILING = 0.08, 1.7
"""What lies between is in the way of the base [m]."""
SURE = 3.2
"""Distance beyond which the depth is too coarse for cells of 10 cm [m]."""
RAYS = 180
"""Directions of one turn in which free floor is told; by eye."""
ENOUGH = 3
"""Points of an occupied cell."""
LEAST = 60
"""Points of a piece of furniture that is made out."""
JUMP = 0.06
"""Difference of depth within a pixel's neighbours that is no jump yet, as a share of the depth: floors slope by less.
By eye."""
GRAIN = 0.04
"""Edge of the cubes in which furniture is kept [m]; by eye."""
SHELVES = ("shelf",)
TOP_SHARE = 0.3
"""Share of the fullest level's cubes: the highest level that has as many is the top; above it are strays at the rims of
things that stand there. By eye."""


def steady(depth: np.ndarray) -> np.ndarray:
    """Return (H, W) bool: pixels of a depth picture [m] that were measured and lie beside no jump, where what is
    measured is of neither side."""
    low = minimum_filter(np.where(depth > 0, depth, np.inf), 3)
    return (depth > 0) & (maximum_filter(depth, 3) - low < JUMP * depth)


def cells_of(points: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return free and occupied cells (N, 2) by points (M, 3) [m] and where the camera was (3,): by rays over the floor
    that end at the first obstacle or at the farthest floor."""
    offset = points[:, :2] - eye[:2]
    away = np.hypot(offset[:, 0], offset[:, 1])
    sure = away < SURE
    points, offset, away = points[sure], offset[sure], away[sure]
    stands = (points[:, 2] > FLOOR) & (points[:, 2] < CEILING)
    cells, counts = np.unique(np.rint(points[stands, :2] / CELL).astype(int), axis=0, return_counts=True)
    occupied = cells[counts >= ENOUGH]
    ray = ((np.arctan2(offset[:, 1], offset[:, 0]) + np.pi) / (2 * np.pi) * RAYS).astype(int) % RAYS
    floor = points[:, 2] < FLOOR / 2
    ends = np.zeros(RAYS)
    np.maximum.at(ends, ray[floor], away[floor])
    blocked = np.full(RAYS, np.inf)
    np.minimum.at(blocked, ray[stands], away[stands])
    ends = np.minimum(ends, blocked - CELL)
    angles = (np.arange(RAYS) + 0.5) / RAYS * 2 * np.pi - np.pi
    steps = np.arange(0.0, SURE, CELL / 2)
    rows = eye[None, None, :2] + steps[None, :, None] * np.stack([np.cos(angles), np.sin(angles)], -1)[:, None]
    free = np.unique(np.rint(rows[steps[None] < ends[:, None]] / CELL).astype(int), axis=0)
    return free.reshape(-1, 2), occupied.reshape(-1, 2)


@dataclass
class SeenPiece:
    """Points of one piece of furniture so far, one for each cube of 4 cm."""

    label: str
    cubes: set[tuple[int, ...]] = field(default_factory=set)
    measured_top: float | None = None
    """Height of its top as the wrist camera measured it [m]."""
    _box: tuple[np.ndarray, np.ndarray] | None = None

    def add(self, points: np.ndarray) -> None:
        """Enter points (N, 3) of one turn."""
        self._box = None
        self.cubes |= set(map(tuple, np.rint(points / GRAIN).astype(int).tolist()))

    def merge(self, other: SeenPiece) -> None:
        """Take over what was seen of another one."""
        self._box = None
        self.cubes |= other.cubes
        self.measured_top = other.measured_top if self.measured_top is None else self.measured_top

    def bare_at(self, x: float, y: float) -> bool:
        """Whether most of its top around a place [m] was seen."""
        i, j, k = (round(value / GRAIN) for value in (x, y, self.top))
        around = product((-1, 0, 1), (-1, 0, 1))
        return sum(any((i + a, j + b, k + c) in self.cubes for c in (-1, 0, 1)) for a, b in around) > 4

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner (3,) [m]."""
        if self._box is None:
            points = np.array(sorted(self.cubes)) * GRAIN
            points = points[clusters(points, 0.2) == 0]
            low, high = np.percentile(points, 1, axis=0), np.percentile(points, 99, axis=0)
            levels, counts = np.unique(points[:, 2], return_counts=True)
            if self.label not in SHELVES:  # whose boards are no tops
                high[2] = levels[counts >= TOP_SHARE * counts.max()].max()
            top = points[np.abs(points[:, 2] - high[2]) < 1.5 * GRAIN, :2]
            if len(top) >= LEAST:  # what stands there is as wide as its top
                low[:2], high[:2] = np.percentile(top, 2, axis=0), np.percentile(top, 98, axis=0)
            self._box = low, high
        return self._box

    @property
    def top(self) -> float:
        """Height of its top [m], as well as it is known."""
        return float(self.box[1][2]) if self.measured_top is None else self.measured_top


def enter(pieces: list[SeenPiece], label: str, points: np.ndarray) -> None:
    """Enter the points of a mask: to the piece of its class that its box overlaps, or as a new piece. Of several that
    it overlaps it makes one: what was seen of a table from two doors came apart."""
    low, high = np.percentile(points, 2, axis=0) - 0.1, np.percentile(points, 98, axis=0) + 0.1
    overlapped = [piece for piece in pieces if piece.label == label and _overlap(piece.box, (low, high))]
    if not overlapped:
        pieces.append(SeenPiece(label))
    first, *others = overlapped or pieces[-1:]
    first.add(points)
    for merged in others:
        first.merge(merged)
    pieces[:] = [piece for piece in pieces if all(piece is not merged for merged in others)]


def _overlap(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]) -> bool:
    return bool(np.all(a[0][:2] < b[1][:2]) and np.all(b[0][:2] < a[1][:2]))
